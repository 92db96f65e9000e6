#include "server/session/stop_keeper.h"

#include <algorithm>
#include <utility>

#include "server/session/stop_file.h"

namespace tenon::session {

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
  if (truth_.engaged()) {
    newest_.who = truth_.standing().begin()->second.who;
    newest_.reason = truth_.standing().begin()->second.reason;
  }
  tellNewest();
  return {};
}

StopChange StopKeeper::note(StopChange change) {
  if (change.superfluous) ended_.push_back(*change.superfluous);
  if (change.forgotten)
    (void)writers_.clear.writer->dispose({change.forgotten->client_guid, change.forgotten->counter, {}, {}});
  has_changed_ = has_changed_ || change.changed;
  return change;
}

void StopKeeper::publish(const EmergencyStop& stop) {
  const RaiseId id{stop.client_guid, stop.counter};
  if (truth_.standing().contains(id)) {
    // one whose clear was forgotten stands again, whatever waits
    const auto is_it = [&](const EmergencyClear& one) { return RaiseId{one.client_guid, one.counter} == id; };
    std::erase_if(ended_, is_it);
    std::erase_if(written_, is_it);
    writers_.stop.send(stop);
  }
  newest_.who = stop.who;
  newest_.reason = stop.reason;
  tellNewest();
  step();
}

void StopKeeper::clear(const std::string& who, const std::string& reason) {
  const auto standing = truth_.standing();
  for (const auto& [id, stop] : standing) {
    ended_.push_back({id.client_guid, id.counter, who, reason});
    note(truth_.clear(ended_.back()));
  }
  step();
}

void StopKeeper::tellNewest() {
  newest_.number = truth_.raised();
  newest_.standing = static_cast<std::uint32_t>(truth_.standing().size());
  writers_.newest_raise.send(newest_);
}

void StopKeeper::step() {
  // one state at a time: of those that come while the disk is busy the newest one follows
  while (!keeper_ || keeper_->isDone(number_)) {
    is_writing_ = false;
    if (const auto why = keeper_ ? keeper_->takeError() : std::nullopt; why && not_kept) not_kept(*why);
    if (!written_.empty()) tellNewest();
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
