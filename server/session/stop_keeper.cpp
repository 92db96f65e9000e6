#include "server/session/stop_keeper.h"

#include <algorithm>
#include <utility>

#include "server/session/stop_file.h"

namespace tenon::session {

namespace {

bool isNamed(const RaiseId& raise, const std::vector<RaiseRange>& named) {
  return std::any_of(named.begin(), named.end(),
                     [&](const RaiseRange& range) { return range.contains(raise); });
}

}  // namespace

StopKeeper::StopKeeper(std::filesystem::path file, ServerWriters& writers)
    : file_(std::move(file)), writers_(writers) {
  if (!file_.empty()) keeper_ = std::make_unique<FileKeeper>();
}

Result<void> StopKeeper::restore() {
  auto kept = readStopFile(file_);
  if (!kept) return fail(kept.error().what);
  truth_ = std::move(*kept);
  for (const auto& [id, stop] : truth_.standing()) writers_.stop.send(stop);
  for (const auto& [id, cleared] : truth_.cleared()) writers_.clear.send(cleared);
  return {};
}

StopChange StopKeeper::note(StopChange change) {
  if (change.superseded) ended_.push_back(*change.superseded);
  if (change.forgotten)
    (void)writers_.clear.writer->dispose({change.forgotten->client_guid, change.forgotten->counter, {}, {}});
  has_changed_ = has_changed_ || change.changed;
  return change;
}

void StopKeeper::publish(const EmergencyStop& stop) {
  writers_.stop.send(stop);
  step();
}

const EmergencyStop* StopKeeper::otherThan(const std::vector<RaiseRange>& named) const {
  for (const auto& [id, stop] : truth_.standing())
    if (!isNamed(id, named)) return &stop;
  return nullptr;
}

void StopKeeper::clear(const std::vector<RaiseRange>& named, const std::string& who,
                       const std::string& reason) {
  const auto standing = truth_.standing();
  for (const auto& [id, stop] : standing) {
    if (!isNamed(id, named)) continue;
    ended_.push_back({id.client_guid, id.counter, who, reason});
    note(truth_.clear(ended_.back()));
  }
  step();
}

void StopKeeper::step() {
  // one state at a time: of those that come while the disk is busy the newest one follows
  while (!keeper_ || keeper_->isDone(number_)) {
    is_writing_ = false;
    if (const auto why = keeper_ ? keeper_->takeError() : std::nullopt; why && not_kept) not_kept(*why);
    for (const EmergencyClear& cleared : std::exchange(written_, {})) {
      writers_.clear.send(cleared);
      (void)writers_.stop.writer->dispose({cleared.client_guid, cleared.counter, {}, {}});
    }
    if (!std::exchange(has_changed_, false)) return;
    written_ = std::exchange(ended_, {});
    if (!keeper_) continue;
    number_ = keeper_->keep([file = file_, truth = truth_] { return writeStopFile(file, truth); });
    is_writing_ = true;
  }
}

}  // namespace tenon::session
