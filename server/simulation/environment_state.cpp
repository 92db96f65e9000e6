#include <algorithm>
#include <cmath>

#include "server/simulation/engine.h"
#include "server/simulation/environment.h"
#include "server/simulation/state_archive.h"

namespace tenon::simulation {
namespace {

/// Incremented with every change of the archived fields.
constexpr std::uint32_t kStateVersion = 12;

template <typename Archive, typename Motion>
void archiveObject(Archive& archive, Motion& object) {
  archive(object.X_WO);
  archive(object.V_WO);
  archive(object.epoch);
  archive(object.status);
  archive(object.holder);
  archive(object.in_contact);
  // bit 0: asleep, bit 1: emerging
  auto flags = static_cast<std::uint8_t>((object.asleep ? 1 : 0) | (object.emerging ? 2 : 0));
  archive(flags);
  if constexpr (Archive::kReads) {
    if (flags > 3) return archive.reject();
    object.asleep = (flags & 1) != 0;
    object.emerging = (flags & 2) != 0;
  }
  archive(object.rest_ticks);
}

template <typename Archive, typename Motion>
void archiveHand(Archive& archive, Motion& hand) {
  archive(hand.present);
  archive(hand.frozen);
  archive(hand.object);
  archive(hand.X_WH);
  archive(hand.V_WH);
  archive(hand.X_WH_before);
  archive(hand.X_HO);
  archive(hand.X_OR);
  archive(hand.F_Ho_W);
  archive(hand.stiffness.translational);
  archive(hand.stiffness.rotational);
  archive(hand.default_object);
  archive(hand.has_pose);
  archive(hand.attached);
  // the hash has nothing of links where there are none, as in most sessions
  if (Archive::kHashes && hand.round_trip == 0.0 && hand.share == 1.0) return;
  archive(hand.round_trip);
  archive(hand.share);
}

/// One bit per pair; pairs that are not near have no other state.
template <typename Archive, typename Engine>
void archiveEnabledBits(Archive& archive, Engine& engine) {
  for (auto& word : engine.enabled_bits) archive(word);
  if constexpr (Archive::kReads) {
    for (std::size_t pair = 0; pair < engine.pairs.size(); ++pair) {
      engine.setEnabled(pair, (engine.enabled_bits[pair / 64] >> pair % 64 & 1U) != 0);
    }
  }
}

/// Indices below `end`, ascending.
template <typename Archive, typename Indices>
void archiveIndices(Archive& archive, Indices& indices, std::size_t end) {
  auto size = static_cast<std::uint32_t>(indices.size());
  archive(size);
  if constexpr (Archive::kReads) indices.clear();
  for (std::uint32_t i = 0; i < size; ++i) {
    std::uint32_t index = Archive::kReads ? 0 : indices[i];
    archive(index);
    if constexpr (Archive::kReads) {
      if (!archive.ok() || index >= end || (i > 0 && index <= indices.back())) return archive.reject();
      indices.push_back(index);
    }
  }
}

}  // namespace

template <typename Archive, typename Self>
void Environment::archive(Archive& archive, Self& self) {
  archive(self.tick_);
  archive(self.free_bodies_paused_);
  archive(self.work_limits_.points);
  archive(self.work_limits_.critical_load);
  for (auto& object : self.objects_) archiveObject(archive, object);
  for (auto& hand : self.hands_) archiveHand(archive, hand);
  auto& engine = *self.engine_;
  archiveEnabledBits(archive, engine);
  for (auto& group : engine.groups) archive(group);
  archiveIndices(archive, engine.near, engine.pairs.size());
  for (const std::uint32_t pair : engine.near) {
    if constexpr (Archive::kReads) {
      if (!engine.pairs[pair].possible()) return archive.reject();
    }
    CollPair::archive(archive, engine.pairs[pair], engine.contact_lists);
  }
  for (auto& path_length : engine.path_lengths) archive(path_length);
  for (auto& buffer : engine.forces) ForceBuffer::archive(archive, buffer);
}

std::uint64_t Environment::hash() const noexcept {
  ArchiveHasher hasher;
  archive(hasher, *this);
  return hasher.value();
}

std::size_t Environment::maxSavedBytes() const {
  // [bytes] a near pair with its two force cells, a full contact list with multipliers, an object
  constexpr std::size_t kPair = 512;
  constexpr std::size_t kList =
      sizeof(collision::IslandPairResult) + collision::kMaxPairContacts * sizeof(double);
  constexpr std::size_t kObject = 1024;
  return save().size() + kObject * objects_.size() + kPair * engine_->pairs.size() +
         kList * contactListCapacity();
}

std::vector<std::uint8_t> Environment::save() const {
  std::vector<std::uint8_t> bytes;
  append(bytes);
  return bytes;
}

void Environment::append(std::vector<std::uint8_t>& bytes) const {
  ArchiveWriter writer(bytes);
  archiveWithHeader(writer);
}

std::vector<std::size_t> Environment::savedDoubles() const {
  ArchiveDoubles doubles;
  archiveWithHeader(doubles);
  return doubles.positions();
}

template <typename Archive>
void Environment::archiveWithHeader(Archive& to) const {
  to.number(kStateVersion);
  to.number(static_cast<std::uint32_t>(objects_.size()));
  to.number(static_cast<std::uint32_t>(hands_.size()));
  to.number(static_cast<std::uint32_t>(pairs_.size()));
  archive(to, *this);
}

Result<void> Environment::restore(std::span<const std::uint8_t> bytes) {
  ArchiveReader reader(bytes);
  std::uint32_t version = 0;
  std::uint32_t objects = 0;
  std::uint32_t hands = 0;
  std::uint32_t pairs = 0;
  for (std::uint32_t* number : {&version, &objects, &hands, &pairs}) reader.number(*number);
  if (!reader.ok()) return fail("checkpoint: empty or truncated header");
  if (version != kStateVersion) {
    return fail("checkpoint: version " + std::to_string(version) + ", this server reads and writes version " +
                std::to_string(kStateVersion));
  }
  if (objects != objects_.size() || hands != hands_.size() || pairs != pairs_.size()) {
    return fail("checkpoint: written for another scene (" + std::to_string(objects) + " objects, " +
                std::to_string(hands) + " hands, " + std::to_string(pairs) + " pairs)");
  }
  // into a copy first, so that an invalid checkpoint changes nothing
  EnvironmentOptions options = options_;
  options.workers = 1;
  Environment copy(scene_, options);
  archive(reader, copy);
  if (!reader.finite()) return fail("checkpoint: contains a number that is not finite");
  if (!reader.atEnd()) return fail("checkpoint: truncated or followed by other bytes");
  if (!copy.isValid()) return fail("checkpoint: contains an invalid pose, id or status");
  objects_ = copy.objects_;
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    copy.hands_[i].rejected_poses = hands_[i].rejected_poses;
    hands_[i] = copy.hands_[i];
  }
  engine_->pairs = std::move(copy.engine_->pairs);
  engine_->enabled_bits = std::move(copy.engine_->enabled_bits);
  engine_->groups = std::move(copy.engine_->groups);
  engine_->near = std::move(copy.engine_->near);
  engine_->contact_lists = std::move(copy.engine_->contact_lists);
  engine_->path_lengths = std::move(copy.engine_->path_lengths);
  engine_->forces = std::move(copy.engine_->forces);
  work_limits_ = copy.work_limits_;
  free_bodies_paused_ = copy.free_bodies_paused_;
  tick_ = copy.tick_;
  engine_->resetWorkspace();
  noteEpochs();
  findMovable();
  countWork();
  for (std::uint32_t pair = 0; pair < pairs_.size(); ++pair) updatePairMotion(pair);
  ++pair_revision_;
  return {};
}

bool Environment::isValid() const noexcept {
  const auto validPose = [](const Pose& X) {
    constexpr double kUnitTolerance = 1e-6;
    return std::abs(X.rotation().squaredNorm() - 1.0) < kUnitTolerance;
  };
  const auto hasBody = [this](const ObjectMotion& object) {
    return scene_->objects[static_cast<std::size_t>(&object - objects_.data())].body.has_value();
  };
  const bool valid_objects = std::all_of(objects_.begin(), objects_.end(), [&](const ObjectMotion& object) {
    return validPose(object.X_WO) && object.status <= ObjectStatus::kFree &&
           (object.status == ObjectStatus::kFree ? hasBody(object) : !object.asleep) &&
           (!object.holder.valid() || isHand(object.holder));
  });
  return work_limits_.critical_load > 0.0 && valid_objects &&
         std::all_of(hands_.begin(), hands_.end(), [&](const HandMotion& hand) {
           return validPose(hand.X_WH) && validPose(hand.X_WH_before) && validPose(hand.X_HO) &&
                  validPose(hand.X_OR) && hand.stiffness.translational > 0.0 &&
                  hand.stiffness.rotational > 0.0 && hand.round_trip >= 0.0 && hand.share > 0.0 &&
                  hand.share <= 1.0 && (!hand.object.valid() || isObject(hand.object)) &&
                  (!hand.default_object.valid() || isObject(hand.default_object));
         });
}

}  // namespace tenon::simulation
