#include "server/session/stop_keeper.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "server/session/stop_file.h"

namespace tenon::session {
namespace {

constexpr const char* kServer = "server";  // guid and name of its own raises

/// NewestRaise::number in this life of the server. Its epoch is one larger each 0.25 s, so numbers of two
/// lives are apart while fewer than 4096 raises come a second; after 12 days they are used again.
std::uint32_t numberOf(std::uint32_t raised, std::uint32_t server_epoch) {
  constexpr std::uint32_t kNumbersOfEpoch = 1024;
  return raised == 0 ? 0 : server_epoch * kNumbersOfEpoch + raised;
}

}  // namespace

StopKeeper::StopKeeper(std::filesystem::path file, ServerWriters& writers, std::uint32_t server_epoch)
    : file_(std::move(file)), writers_(writers), server_epoch_(server_epoch) {
  if (!file_.empty()) keeper_ = std::make_unique<FileKeeper>();
}

Result<void> StopKeeper::restore() {
  auto kept = readStopFile(file_);
  if (!kept) return fail(kept.error().what);
  truth_ = std::move(*kept);
  for (const auto& [client, cleared] : truth_.cleared()) writers_.clear.send(cleared);
  const auto standing = truth_.standing();
  for (const auto& [client, stop] : standing) writers_.stop.send(stop);
  if (standing.empty()) {
    tellNewest();
    return {};
  }
  const EmergencyStop again = ownRaise("it stood when this server started");
  if (const StopChange change = raise(again)) publish(again, change);
  newest_.who = standing.begin()->second.who;
  newest_.reason = standing.begin()->second.reason;
  tellNewest();
  return {};
}

EmergencyStop StopKeeper::ownRaise(const std::string& reason) const {
  EmergencyStop stop{.client_guid = kServer, .counter = server_epoch_, .who = kServer, .reason = reason};
  const std::uint32_t known = truth_.newestOf(stop.client_guid);
  if (known >= stop.counter) stop.counter = known + 1;
  // somebody has used up the numbers of this name
  if (stop.counter == 0) stop.client_guid += fmt::format(" {}", server_epoch_);
  return stop;
}

StopChange StopKeeper::note(StopChange change) {
  if (change.superfluous) ended_.push_back(*change.superfluous);
  if (change.forgotten) (void)writers_.clear.writer->dispose(*change.forgotten);
  has_changed_ = has_changed_ || change.changed;
  return change;
}

void StopKeeper::publish(const EmergencyStop& stop, const StopChange& change) {
  if (truth_.stands(stop)) {
    // one whose clear was forgotten stands again, whatever waits
    const auto names_it = [&](const EmergencyClear& one) {
      return one.client_guid == stop.client_guid && one.counter >= stop.counter;
    };
    std::erase_if(ended_, names_it);
    std::erase_if(written_, names_it);
    writers_.stop.send(stop);
  }
  if (change.ended) (void)writers_.stop.writer->dispose(*change.ended);
  newest_.who = stop.who;
  newest_.reason = stop.reason;
  tellNewest();
  step();
}

void StopKeeper::clear(const std::string& who, const std::string& reason) {
  const auto standing = truth_.standing();
  for (const auto& [client, stop] : standing) {
    ended_.push_back({client, stop.counter, who, reason});
    note(truth_.clear(ended_.back()));
  }
  step();
}

void StopKeeper::tellNewest() {
  newest_.number = numberOf(truth_.raised(), server_epoch_);
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
