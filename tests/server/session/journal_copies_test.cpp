#include "server/session/journal_copies.h"

#include <chrono>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include "idl/wire/codec.h"
#include "idl/wire/network.h"
#include "idl/wire/raw_subscriber.h"
#include "tests/idl/wire/peer.h"

namespace tenon::session {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kLargeCheckpoint = 200'000;  // [bytes]

const std::string kSession = "copies";

/// What a recorder subscribes to for itself.
class RecorderMock {
 public:
  explicit RecorderMock(std::uint32_t domain)
      : bus_(test::participant(domain)),
        partition_(bus_, wire::clientPartition(kSession, bus_->origin())),
        subscriber_(std::move(*wire::RawSubscriber::open(
            partition_, {std::string(wire::kCheckpoint.name), std::string(wire::kTickInput.name)}))) {}

  [[nodiscard]] wire::Origin origin() const { return bus_->origin(); }
  void take() {
    subscriber_.dispatch(milliseconds(1), [this](const wire::RawSample& sample) {
      if (sample.gone) return;
      if (sample.topic == wire::kTickInput.name)
        ticks.push_back(wire::decode<TickInputPart>(sample.bytes)->tick);
      else
        ++checkpoint_parts;
    });
  }

  std::vector<Tick> ticks;
  std::size_t checkpoint_parts = 0;

 private:
  std::shared_ptr<wire::Participant> bus_;
  wire::Partition partition_;
  wire::RawSubscriber subscriber_;
};

JournalEntry entryOf(Tick tick, std::size_t checkpoint_bytes = 0) {
  return {.input = {.tick = tick}, .hash = tick, .checkpoint = std::vector<std::uint8_t>(checkpoint_bytes)};
}

std::vector<Tick> ticks(Tick from, Tick to) {
  std::vector<Tick> all;
  for (Tick tick = from; tick <= to; ++tick) all.push_back(tick);
  return all;
}

/// Adds an entry a millisecond, as a session does, until `done`; the tick of the last one. Fails after a
/// minute.
Tick addUntil(JournalCopies& copies, Tick tick, std::size_t checkpoint_bytes, const auto& done) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!done()) {
    if (std::chrono::steady_clock::now() > until) {
      ADD_FAILURE() << "not within a minute";
      return tick;
    }
    copies.add(entryOf(++tick, checkpoint_bytes));
    std::this_thread::sleep_for(milliseconds(1));
  }
  return tick;
}

/// Opens a DDS domain that forgets a process which has stopped after a minute, not after 2 s.
std::shared_ptr<wire::Participant> openPatientDomain(std::uint32_t domain) {
  return *wire::Participant::open({.domain = domain,
                                   .config = wire::networkConfig(*wire::chosenNetwork()) +
                                             ",<CycloneDDS><Domain><Discovery><LeaseDuration>60 s"
                                             "</LeaseDuration></Discovery></Domain></CycloneDDS>"});
}

bool isReadable(int pipe) {
  pollfd polled{.fd = pipe, .events = POLLIN, .revents = 0};
  return poll(&polled, 1, 0) == 1;
}

//  recorder A   joins at 3: gets 1 ...
//  recorder B   joins later: gets 1 ... likewise
//  tick         1 2 3 ...
TEST(JournalCopies, EachRecorderGetsWhatWasKeptAndWhatFollowsInOrder) {
  const std::uint32_t domain = test::ownDomain();
  JournalCopies copies(test::participant(domain), kSession);
  RecorderMock a(domain), b(domain);
  Tick tick = 0;
  while (tick < 3) copies.add(entryOf(++tick));
  copies.admit(ClientId{1}, a.origin());
  tick = addUntil(copies, tick, 0, [&] { return a.take(), a.ticks.size() >= 50; });
  EXPECT_TRUE(b.ticks.empty());
  copies.admit(ClientId{2}, b.origin());
  tick = addUntil(copies, tick, 0, [&] { return b.take(), b.ticks.size() >= 50; });
  copies.finish(std::chrono::steady_clock::now() + std::chrono::seconds(10));
  for (RecorderMock* recorder : {&a, &b}) {
    for (int i = 0; i < 100 && recorder->ticks.size() < tick; ++i) recorder->take();
    EXPECT_EQ(recorder->ticks, ticks(1, tick));
  }
  EXPECT_EQ(copies.counts().failed, 0U);
  EXPECT_TRUE(copies.takeStuck().empty());
}

TEST(JournalCopies, ARecorderThatBeginsLateHasNoGap) {
  const std::uint32_t domain = test::ownDomain();
  JournalCopies copies(test::participant(domain), kSession);
  Tick tick = 0;
  while (tick < kKeptForRecorders + 100) copies.add(entryOf(++tick));
  RecorderMock recorder(domain);
  copies.admit(ClientId{1}, recorder.origin());
  tick = addUntil(copies, tick, 0, [&] { return recorder.take(), recorder.ticks.size() >= 50; });
  copies.finish(std::chrono::steady_clock::now() + std::chrono::seconds(10));
  for (int i = 0; i < 1000 && (recorder.ticks.empty() || recorder.ticks.back() < tick); ++i) recorder.take();
  ASSERT_FALSE(recorder.ticks.empty());
  EXPECT_LT(recorder.ticks.front(), tick - kKeptForRecorders / 2) << "most of what was kept";
  EXPECT_EQ(recorder.ticks, ticks(recorder.ticks.front(), tick));
  EXPECT_EQ(copies.counts().failed, 0U);
}

TEST(JournalCopies, ARecorderThatIsDismissedGetsNoMoreAndEverythingWhenItIsBack) {
  const std::uint32_t domain = test::ownDomain();
  JournalCopies copies(test::participant(domain), kSession);
  RecorderMock recorder(domain);
  copies.admit(ClientId{1}, recorder.origin());
  Tick tick = addUntil(copies, 0, 0, [&] { return recorder.take(), recorder.ticks.size() >= 50; });
  copies.finish(std::chrono::steady_clock::now() + std::chrono::seconds(10));
  for (int i = 0; i < 100 && recorder.ticks.size() < tick; ++i) recorder.take();
  copies.dismiss(ClientId{1});
  for (int i = 0; i < 20; ++i) {
    copies.add(entryOf(++tick));
    recorder.take();
  }
  EXPECT_EQ(recorder.ticks, ticks(1, tick - 20));
  recorder.ticks.clear();
  copies.admit(ClientId{1}, recorder.origin());
  tick = addUntil(copies, tick, 0, [&] { return recorder.take(), recorder.ticks.size() >= tick + 20; });
  recorder.ticks.resize(50);
  EXPECT_EQ(recorder.ticks, ticks(1, 50)) << "what a recorder has already it skips";
}

TEST(JournalCopies, ARecorderThatSaysWhatItHasGetsTheRestAlone) {
  const std::uint32_t domain = test::ownDomain();
  JournalCopies copies(test::participant(domain), kSession);
  RecorderMock recorder(domain);
  Tick tick = 100;  // of a session that was resumed
  while (tick < 300) copies.add(entryOf(++tick));
  copies.admit(ClientId{1}, recorder.origin(), 250);
  tick = addUntil(copies, tick, 0, [&] { return recorder.take(), recorder.ticks.size() >= 60; });
  recorder.ticks.resize(60);
  EXPECT_EQ(recorder.ticks, ticks(251, 310));
}

// Large checkpoints fill the history of a writer whose reader hangs while its lease lasts.
TEST(JournalCopiesOfAPeer, ARecorderThatHangsIsGivenUpAndAnotherOneMissesNothing) {
  const std::uint32_t domain = test::ownDomain();
  int guid_pipe[2];
  ASSERT_EQ(pipe(guid_pipe), 0);
  test::Peer peer([&] {
    const auto patient = openPatientDomain(domain);
    RecorderMock recorder(domain);
    const wire::Origin origin = recorder.origin();
    (void)!write(guid_pipe[1], origin.guid.data(), origin.guid.size());
    while (recorder.ticks.size() < 10 || recorder.checkpoint_parts < 10) recorder.take();
    (void)!write(guid_pipe[1], origin.guid.data(), 1);
    while (true) recorder.take();
  });
  wire::Origin hanging;
  ASSERT_EQ(read(guid_pipe[0], hanging.guid.data(), hanging.guid.size()), 16);

  const auto patient = openPatientDomain(domain);
  JournalCopies copies(test::participant(domain), kSession);
  RecorderMock living(domain);
  copies.admit(ClientId{1}, hanging);
  copies.admit(ClientId{2}, living.origin());
  // it hangs once both writers know its readers; what is written before waits for nobody
  Tick tick = addUntil(copies, 0, 1, [&] { return living.take(), isReadable(guid_pipe[0]); });
  peer.stop();
  std::vector<ClientId> stuck;
  tick = addUntil(copies, tick, kLargeCheckpoint, [&] {
    living.take();
    for (const ClientId client : copies.takeStuck()) stuck.push_back(client);
    return !stuck.empty();
  });
  EXPECT_EQ(stuck, std::vector{ClientId{1}});
  EXPECT_GT(copies.counts().failed, 0U);
  EXPECT_GT(copies.counts().slow, 0U);
  tick = addUntil(copies, tick, 0, [&] { return living.take(), living.ticks.size() >= tick; });
  EXPECT_EQ(living.ticks, ticks(1, tick));
  close(guid_pipe[0]);
  close(guid_pipe[1]);
}

}  // namespace
}  // namespace tenon::session
