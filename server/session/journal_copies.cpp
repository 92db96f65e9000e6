#include "server/session/journal_copies.h"

#include <algorithm>
#include <iterator>
#include <thread>
#include <utility>

namespace tenon::session {
namespace {

constexpr std::size_t kMostAtOnce = 8;  // [entries] for one recorder at each new one
constexpr std::chrono::seconds kStuck{1};
constexpr std::chrono::milliseconds kRetry{20};
// A recorder that begins does so with an entry that is still kept when its readers are found.
constexpr Tick kBeginsWith =
    kKeptForRecorders - 2 * kStuck / std::chrono::milliseconds(1);  // [entries] at most

}  // namespace

void JournalCopies::admit(ClientId client, const wire::Origin& from, Tick recorded_until) {
  const std::lock_guard lock(mutex_);
  requests_.push_back({client, from, recorded_until});
}

void JournalCopies::dismiss(ClientId client) {
  const std::lock_guard lock(mutex_);
  requests_.push_back({client, std::nullopt});
}

std::vector<ClientId> JournalCopies::takeStuck() {
  const std::lock_guard lock(mutex_);
  return std::exchange(stuck_, {});
}

WriteCounts JournalCopies::counts() const {
  const std::lock_guard lock(mutex_);
  return shown_counts_;
}

void JournalCopies::handleRequests() {
  const auto requests = [this] {
    const std::lock_guard lock(mutex_);
    return std::exchange(requests_, {});
  }();
  for (const Request& request : requests) {
    recorders_.remove_if([&](const Recorder& recorder) { return recorder.client == request.client; });
    if (request.from) open(request);
  }
}

/// The number of the oldest entry kept of a later tick.
std::uint64_t JournalCopies::firstAfter(Tick tick) const {
  const auto found =
      std::find_if(kept_.begin(), kept_.end(), [&](const Copy& copy) { return copy.tick > tick; });
  return first_ + static_cast<std::uint64_t>(found - kept_.begin());
}

void JournalCopies::open(const Request& request) {
  wire::Partition partition(participant_, wire::clientPartition(session_, *request.from));
  auto inputs = wire::Writer<TickInputPart>::open(partition, wire::kTickInput);
  auto checkpoints = wire::Writer<CheckpointPart>::open(partition, wire::kCheckpoint);
  std::uint64_t next = firstAfter(request.recorded_until);
  if (request.recorded_until == 0 && !inLockstep() && end() > kBeginsWith)
    next = std::max(next, end() - kBeginsWith);
  if (inputs && checkpoints) {
    recorders_.push_back({request.client,
                          std::move(partition),
                          std::move(*inputs),
                          std::move(*checkpoints),
                          next,
                          {},
                          {},
                          {},
                          {}});
  } else {
    const std::lock_guard lock(mutex_);
    stuck_.push_back(request.client);
  }
}

void JournalCopies::add(const JournalEntry& entry) {
  Copy copy{.tick = entry.input.tick, .inputs = {}, .checkpoint = {}};
  std::vector<std::uint8_t> bytes;
  appendBytes(entry.input, bytes);
  forEachPart<TickInputPart>(entry.input.tick, entry.hash, bytes,
                             [&](const auto& part) { copy.inputs.push_back(part); });
  if (!entry.checkpoint.empty())
    forEachPart<CheckpointPart>(entry.input.tick, entry.hash, entry.checkpoint,
                                [&](const auto& part) { copy.checkpoint.push_back(part); });
  kept_.push_back(std::move(copy));
  if (kept_.size() > kKeptForRecorders) {
    kept_.pop_front();
    ++first_;
  }
  handleRequests();
  const Time now = std::chrono::steady_clock::now();
  for (Recorder& recorder : recorders_) serve(recorder, now);

  std::list<Recorder> given_up;  // deleted without the lock: their writers may take long to be
  for (auto recorder = recorders_.begin(); recorder != recorders_.end();) {
    const auto next = std::next(recorder);
    if (isStuck(*recorder, now)) given_up.splice(given_up.end(), recorders_, recorder);
    recorder = next;
  }
  const std::lock_guard lock(mutex_);
  for (const Recorder& recorder : given_up) {
    counts_.failed += end() - recorder.next;
    stuck_.push_back(recorder.client);
  }
  shown_counts_ = counts_;
}

bool JournalCopies::isStuck(const Recorder& recorder, Time now) {
  return recorder.waits_since && now - *recorder.waits_since >= kStuck;
}

bool JournalCopies::serve(Recorder& recorder, Time now) {
  if (recorder.next < first_) {
    counts_.failed += first_ - recorder.next;
    recorder.next = first_;
  }
  if (now < recorder.retry_at) return false;
  const auto wait = [&] {
    if (!recorder.waits_since) recorder.waits_since = now;
    recorder.retry_at = now + kRetry;
    return false;
  };
  // What is written before the recorder knows this writer is sent once more, by the thread that receives from
  // all clients. So one entry goes ahead.
  if (!inLockstep() && recorder.has_first && !recorder.is_matched) {
    recorder.is_matched = recorder.inputs.waitForReaders(std::chrono::nanoseconds(0));
    if (!recorder.is_matched) return wait();
    recorder.waits_since.reset();
  }
  for (std::size_t i = 0; recorder.next < end() && (inLockstep() || i < kMostAtOnce); ++i) {
    if (!write(recorder, kept_[recorder.next - first_])) return wait();
    recorder.waits_since.reset();
    ++recorder.next;
    if (!std::exchange(recorder.has_first, true) && !inLockstep()) return false;
  }
  return recorder.next == end();
}

/// In whole: recorders skip the parts that they have.
bool JournalCopies::write(Recorder& recorder, const Copy& copy) {
  const auto put = [&](auto& writer, const auto& parts) {
    return std::all_of(parts.begin(), parts.end(), [&](const auto& part) {
      return counts_.time([&] { return writer.write(part).has_value(); });
    });
  };
  return put(recorder.inputs, copy.inputs) && put(recorder.checkpoints, copy.checkpoint);
}

void JournalCopies::finish(Time until) {
  handleRequests();
  const auto rest = [&] {
    return std::max(Time::duration::zero(), until - std::chrono::steady_clock::now());
  };
  const auto all_served = [&] {
    const Time now = std::chrono::steady_clock::now();
    bool all = true;
    for (Recorder& recorder : recorders_) all = (isStuck(recorder, now) || serve(recorder, now)) && all;
    return all;
  };
  while (!all_served() && rest() > Time::duration::zero())
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  for (Recorder& recorder : recorders_) {
    (void)recorder.inputs.waitForReaders(rest());
    (void)recorder.checkpoints.waitForReaders(rest());
  }
  const std::lock_guard lock(mutex_);
  for (const Recorder& recorder : recorders_) counts_.failed += end() - recorder.next;
  shown_counts_ = counts_;
}

}  // namespace tenon::session
