#include "server/simulation/compiled_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>

#include "idl/types/bytes.h"
#include "server/structures/structure_bytes.h"

namespace tenon::simulation {
namespace {

// "TENONSC\n", the version, the byte order; then the structures, each at a multiple of kAlignment with its
// size before it; then the rest.
constexpr std::array<char, 8> kMagic{'T', 'E', 'N', 'O', 'N', 'S', 'C', '\n'};
constexpr std::uint32_t kVersion = 1;
constexpr std::uint32_t kByteOrder = 0x01020304U;
constexpr std::size_t kAlignment = 64;
constexpr std::uint32_t kNoStructures = 0xFFFFFFFFU;
constexpr std::size_t kMaxText = 255;  // [bytes]

// what a scenario may have, and more than any has
constexpr std::uint32_t kMostObjects = 100'000, kMostPairs = 1'000'000, kMostHands = 64;
constexpr double kFarthest = 1e3;        // [m]
constexpr double kMostGravity = 100.0;   // [m/s^2]
constexpr double kMostDamping = 100.0;   // [1/s]
constexpr double kLeastInertia = 1e-15;  // [kg m^2]
constexpr double kMaxNumber = 1e9;       // [SI] of stiffness, mass

std::size_t aligned(std::size_t offset) { return (offset + kAlignment - 1) / kAlignment * kAlignment; }

class SceneWriter {
 public:
  Result<std::vector<std::uint8_t>> write(const Scene& scene) {
    for (const char letter : kMagic) out_.put(letter);
    out_.put(kVersion);
    out_.put(kByteOrder);
    if (auto written = writeStructures(scene); !written) return fail(written.error().what);
    out_.put(scene.gravity_W);
    out_.put(static_cast<std::uint32_t>(scene.objects.size()));
    for (const ObjectSpec& object : scene.objects) write(object);
    out_.put(static_cast<std::uint32_t>(scene.pairs.size()));
    for (const PairSpec& pair : scene.pairs) write(pair);
    out_.put(static_cast<std::uint32_t>(scene.hands.size()));
    for (const HandSpec& hand : scene.hands) write(hand);
    return std::move(bytes_);
  }

 private:
  using Structures = structures::HapticStructures;

  Result<void> writeStructures(const Scene& scene) {
    for (const ObjectSpec& object : scene.objects)
      if (object.structures && indexOf(object.structures.get()) == kNoStructures)
        structures_.push_back(object.structures.get());
    out_.put(static_cast<std::uint32_t>(structures_.size()));
    for (const Structures* const structures : structures_) {
      const auto block = structures::structureBytes(*structures);
      if (!block) return fail(block.error().what);
      out_.put(std::uint64_t{block->size()});
      bytes_.resize(aligned(bytes_.size()));
      bytes_.insert(bytes_.end(), block->begin(), block->end());
    }
    return {};
  }

  [[nodiscard]] std::uint32_t indexOf(const Structures* structures) const {
    const auto found = std::find(structures_.begin(), structures_.end(), structures);
    return found == structures_.end() ? kNoStructures
                                      : static_cast<std::uint32_t>(found - structures_.begin());
  }

  void put(const std::string& text) {
    const std::size_t length = std::min(text.size(), kMaxText);
    out_.put(static_cast<std::uint8_t>(length));
    bytes_.insert(bytes_.end(), text.begin(), text.begin() + static_cast<std::ptrdiff_t>(length));
  }

  void write(const ObjectSpec& object) {
    put(object.name);
    put(object.kind);
    out_.put(object.group);
    out_.put(object.X_WO);
    out_.put(object.status);
    out_.put(indexOf(object.structures.get()));
    out_.put(object.stiffness);
    out_.put(object.body.has_value());
    if (!object.body) return;
    const BodySpec& body = *object.body;
    out_.put(body.mass);
    out_.put(body.p_OC_O);
    for (int i = 0; i < 3; ++i) out_.put(Vector3(body.inertia_C_O.col(i)));
    out_.put(body.floating);
    out_.put(body.damping);
    out_.put(body.friction);
  }

  void write(const PairSpec& pair) {
    out_.put(pair.a);
    out_.put(pair.b);
    out_.put(pair.enabled);
    out_.put(pair.sensing);
    out_.put(pair.friction.has_value());
    if (pair.friction) out_.put(pair.friction->at_rest), out_.put(pair.friction->sliding);
    out_.put(pair.most_dilation_a);
  }

  void write(const HandSpec& hand) {
    put(hand.name);
    out_.put(hand.role);
    out_.put(hand.kind);
    out_.put(hand.object);
    out_.put(hand.stiffness);
    out_.put(hand.rotational_stiffness);
  }

  std::vector<std::uint8_t> bytes_;
  ByteWriter out_{bytes_};
  std::vector<const Structures*> structures_;
};

bool inRange(double number, double least, double most) { return number >= least && number <= most; }
bool isSmall(const Vector3& v, double most) { return v.allFinite() && v.cwiseAbs().maxCoeff() <= most; }
bool isPlacement(const Pose& X) {
  constexpr double kUnitTolerance = 1e-6;
  return X.isFinite() && isSmall(X.translation(), kFarthest) &&
         std::abs(X.rotation().squaredNorm() - 1.0) < kUnitTolerance;
}
bool isInertia(const Matrix3& inertia) {
  // of a rotated tensor, rounding leaves a little asymmetry
  constexpr double kAsymmetry = 1e-9;  // [-]
  if (!inertia.allFinite() ||
      (inertia - inertia.transpose()).cwiseAbs().maxCoeff() > kAsymmetry * inertia.cwiseAbs().maxCoeff())
    return false;
  const Eigen::LLT<Matrix3> root(inertia);
  return root.info() == Eigen::Success && inertia.diagonal().minCoeff() >= kLeastInertia &&
         inertia.cwiseAbs().maxCoeff() <= kMaxNumber;
}

/// Reads part by part; problem() is what is wrong with the last one, or null.
class SceneReader {
 public:
  explicit SceneReader(std::span<const std::uint8_t> bytes) : bytes_(bytes), in_(bytes) {}

  Result<std::shared_ptr<const Scene>> read() {
    if (const char* problem = readHeader()) return refused(problem);
    if (auto structures = readStructures(); !structures) return fail(structures.error().what);
    auto scene = std::make_shared<Scene>();
    in_.get(scene->gravity_W);
    if (!isSmall(scene->gravity_W, kMostGravity)) return refused("its gravity is no acceleration");
    if (!readList(scene->objects, kMostObjects)) return refused("one of its objects is not valid");
    objects_ = scene->objects.size();
    if (!readList(scene->pairs, kMostPairs)) return refused("one of its pairs is not valid");
    if (!readList(scene->hands, kMostHands)) return refused("one of its hands is not valid");
    if (!in_.ok() || !in_.atEnd()) return refused("it has another length than it says");
    return std::shared_ptr<const Scene>(std::move(scene));
  }

 private:
  static tl::unexpected<Error> refused(const std::string& problem) {
    return fail("the compiled scene cannot be used: " + problem);
  }

  const char* readHeader() {
    std::array<char, 8> magic{};
    std::uint32_t version = 0, byte_order = 0;
    for (char& letter : magic) in_.get(letter);
    in_.get(version);
    in_.get(byte_order);
    if (!in_.ok() || magic != kMagic) return "it is none";
    if (version != kVersion) return "it has another version than this program reads";
    if (byte_order != kByteOrder) return "it is of a machine with another byte order";
    return nullptr;
  }

  Result<void> readStructures() {
    std::uint32_t count = 0;
    in_.get(count);
    for (std::uint32_t i = 0; i < count; ++i) {
      std::uint64_t size = 0;
      in_.get(size);
      in_.skip(aligned(in_.position()) - in_.position());
      const std::size_t at = in_.position();
      if (!in_.ok() || size > bytes_.size() - at) return refused("a structure of it is cut off");
      in_.skip(size);
      auto one = structures::readStructures(std::as_bytes(bytes_.subspan(at, size)),
                                            "structure " + std::to_string(i) + " of the compiled scene");
      if (!one) return fail(one.error().what);
      structures_.push_back(std::move(*one));
    }
    return {};
  }

  /// A damaged count makes no list longer than what there are bytes for.
  template <class Spec>
  bool readList(std::vector<Spec>& list, std::uint32_t most) {
    std::uint32_t count = 0;
    in_.get(count);
    if (count > most) return false;
    for (std::uint32_t i = 0; i < count; ++i)
      if (!read(list.emplace_back()) || !in_.ok()) return false;
    return true;
  }

  void get(std::string& text) {
    std::uint8_t length = 0;
    in_.get(length);
    const std::size_t at = in_.position();
    in_.skip(length);
    if (in_.ok()) text.assign(reinterpret_cast<const char*>(bytes_.data()) + at, length);
  }

  bool read(ObjectSpec& object) {
    std::uint32_t structures = kNoStructures;
    bool has_body = false;
    get(object.name);
    get(object.kind);
    object.title = object.name;
    in_.get(object.group);
    in_.get(object.X_WO);
    in_.get(object.status);
    in_.get(structures);
    in_.get(object.stiffness);
    in_.get(has_body);
    const bool known = structures == kNoStructures || structures < structures_.size();
    if (!in_.ok() || !known || !isPlacement(object.X_WO) || object.status > ObjectStatus::kFree ||
        !inRange(object.stiffness, 0.0, kMaxNumber))
      return false;
    if (structures != kNoStructures) object.structures = structures_[structures];
    if (!has_body) return true;
    BodySpec& body = object.body.emplace();
    in_.get(body.mass);
    in_.get(body.p_OC_O);
    for (int i = 0; i < 3; ++i) {
      Vector3 column;
      in_.get(column);
      body.inertia_C_O.col(i) = column;
    }
    in_.get(body.floating);
    in_.get(body.damping);
    in_.get(body.friction);
    return inRange(body.mass, 1e-9, kMaxNumber) && isSmall(body.p_OC_O, kFarthest) &&
           isInertia(body.inertia_C_O) && inRange(body.damping, 0.0, kMostDamping) &&
           inRange(body.friction, 0.0, kMaxNumber);
  }

  bool read(PairSpec& pair) {
    bool has_friction = false;
    in_.get(pair.a);
    in_.get(pair.b);
    in_.get(pair.enabled);
    in_.get(pair.sensing);
    in_.get(has_friction);
    if (has_friction) {
      collision::Friction& friction = pair.friction.emplace();
      in_.get(friction.at_rest);
      in_.get(friction.sliding);
      if (!inRange(friction.at_rest, 0.0, kMaxNumber) || !inRange(friction.sliding, 0.0, friction.at_rest))
        return false;
    }
    in_.get(pair.most_dilation_a);
    return pair.a.value < objects_ && pair.b.value < objects_ && pair.a != pair.b &&
           pair.most_dilation_a >= 0.0;
  }

  bool read(HandSpec& hand) {
    get(hand.name);
    in_.get(hand.role);
    in_.get(hand.kind);
    in_.get(hand.object);
    in_.get(hand.stiffness);
    in_.get(hand.rotational_stiffness);
    const bool is_known = !hand.object.valid() || hand.object.value < objects_;
    return is_known && hand.role <= Role::kRecorder && hand.kind <= HandKind::kTracked &&
           inRange(hand.stiffness, 1e-9, kMaxNumber) && inRange(hand.rotational_stiffness, 1e-9, kMaxNumber);
  }

  std::span<const std::uint8_t> bytes_;
  ByteReader in_;
  std::vector<std::shared_ptr<const structures::HapticStructures>> structures_;
  std::size_t objects_ = 0;
};

}  // namespace

Result<std::vector<std::uint8_t>> sceneBytes(const Scene& scene) { return SceneWriter().write(scene); }

Result<std::shared_ptr<const Scene>> readScene(std::span<const std::uint8_t> bytes) {
  return SceneReader(bytes).read();
}

}  // namespace tenon::simulation
