#include "clients/haptic/answer_readers.h"

#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "idl/types/messages/contacts.h"
#include "tests/clients/haptic/joined_station.h"

namespace tenon::haptic {
namespace {

/// Samples of each tick have odd ticks here, slow ones even ticks.
class AnswerReadersTest : public JoinedStation {
 protected:
  AnswerReadersTest() : JoinedStation({HandId{1}}) {}

  void SetUp() override {
    JoinedStation::SetUp();
    readers_ = std::make_unique<AnswerReaders>(
        *link_, AnswerReaders::Callbacks{.frame = [this](const WorldFrame& frame) { count(frame.tick); },
                                         .manifold = [this](const HandManifold& one) { count(one.tick); }});
  }
  void count(Tick tick) { ++(tick % 2 == 1 ? of_each_tick_ : slow_); }
  /// Both kinds of both topics are sent, until the station has heard what it reads.
  void send() {
    ASSERT_TRUE(frames_.write({.tick = 1}));
    ASSERT_TRUE(slow_frames_.write({.tick = 2}));
    ASSERT_TRUE(manifolds_.write({.hand = HandId{1}, .tick = 1}));
    ASSERT_TRUE(slow_manifolds_.write({.hand = HandId{1}, .tick = 2}));
  }
  [[nodiscard]] bool matches(std::size_t each_tick, std::size_t slow) {
    return frames_.matchedReaders() == each_tick && manifolds_.matchedReaders() == each_tick &&
           slow_frames_.matchedReaders() == slow && slow_manifolds_.matchedReaders() == slow;
  }
  /// Waits for these readers, and expects the two samples of each.
  void expectRead(std::size_t each_tick, std::size_t slow) {
    ASSERT_TRUE(hearUntil([&] { return matches(each_tick, slow); }));
    hear();
    of_each_tick_ = slow_ = 0;
    send();
    EXPECT_TRUE(hearUntil([&] { return of_each_tick_ == 2 * each_tick && slow_ == 2 * slow; }));
    hear();
    EXPECT_EQ(of_each_tick_, 2 * each_tick);
    EXPECT_EQ(slow_, 2 * slow);
  }

  wire::Partition hand_{server_.bus(), wire::handPartition("test", HandId{1})};
  wire::Writer<WorldFrame> frames_ =
      wire::Writer<WorldFrame>::open(server_.session(), wire::kWorldFrame1k).value();
  wire::Writer<WorldFrame> slow_frames_ =
      wire::Writer<WorldFrame>::open(server_.session(), wire::kWorldFrame100).value();
  wire::Writer<HandManifold> manifolds_ =
      wire::Writer<HandManifold>::open(hand_, wire::kHandManifold).value();
  wire::Writer<HandManifold> slow_manifolds_ =
      wire::Writer<HandManifold>::open(hand_, wire::kHandManifold50).value();
  std::unique_ptr<AnswerReaders> readers_;
  std::size_t of_each_tick_ = 0;
  std::size_t slow_ = 0;
};

TEST_F(AnswerReadersTest, ReadThoseOfEachTickFirst) {
  ASSERT_TRUE(readers_->open());
  expectRead(1, 0);
  ASSERT_TRUE(readers_->choose(false));
  expectRead(1, 0);
}

TEST_F(AnswerReadersTest, HaveBothKindsInBetweenSoThatNoAnswerIsMissing) {
  ASSERT_TRUE(readers_->open());
  expectRead(1, 0);
  ASSERT_TRUE(readers_->choose(true));
  EXPECT_FALSE(readers_->hasSlowAlone()) << "a loss of slow answers cannot be counted yet";
  expectRead(1, 1);
  ASSERT_TRUE(readers_->choose(true));
  EXPECT_TRUE(readers_->hasSlowAlone());
  expectRead(0, 1);
  ASSERT_TRUE(readers_->choose(true));
  expectRead(0, 1);
  ASSERT_TRUE(readers_->choose(false));
  EXPECT_FALSE(readers_->hasSlowAlone());
}

TEST_F(AnswerReadersTest, GoBackToThoseThatHearWhenTheChoiceChangesInBetween) {
  ASSERT_TRUE(readers_->open());
  ASSERT_TRUE(readers_->choose(true));
  ASSERT_TRUE(readers_->choose(false));
  expectRead(1, 0);
  ASSERT_TRUE(readers_->choose(true));
  expectRead(1, 1);
  ASSERT_TRUE(readers_->choose(true));
  expectRead(0, 1);
}

TEST_F(AnswerReadersTest, KeepTheFormerOnesUntilTheNewOnesHaveHeardAll) {
  ASSERT_TRUE(readers_->open());
  ASSERT_TRUE(readers_->choose(true));
  ASSERT_TRUE(hearUntil([&] { return matches(1, 1); }));
  ASSERT_TRUE(manifolds_.write({.hand = HandId{1}, .tick = 1}));
  ASSERT_TRUE(slow_frames_.write({.tick = 2}));
  ASSERT_TRUE(hearUntil([&] { return of_each_tick_ == 1 && slow_ == 1; }));
  for (int call = 1; call < AnswerReaders::kMostCalls; ++call) {
    ASSERT_TRUE(readers_->choose(true));
    hear();
    ASSERT_TRUE(matches(1, 1)) << "no slow manifold, call " << call;
  }
  ASSERT_TRUE(readers_->choose(true));
  expectRead(0, 1);
}

TEST_F(AnswerReadersTest, DoNotWaitForManifoldsOfAnAbsentHand) {
  ASSERT_TRUE(readers_->open());
  ASSERT_TRUE(readers_->choose(true));
  ASSERT_TRUE(hearUntil([&] { return matches(1, 1); }));
  ASSERT_TRUE(frames_.write({.tick = 1}));
  ASSERT_TRUE(hearUntil([&] { return of_each_tick_ == 1; }));
  ASSERT_TRUE(readers_->choose(true));
  hear();
  EXPECT_TRUE(matches(1, 1)) << "the new ones have heard nothing";
  ASSERT_TRUE(slow_frames_.write({.tick = 2}));
  ASSERT_TRUE(hearUntil([&] { return slow_ == 1; }));
  ASSERT_TRUE(readers_->choose(true));
  EXPECT_TRUE(readers_->hasSlowAlone());
  expectRead(0, 1);
}

TEST_F(AnswerReadersTest, CountWhatDoesNotArriveAndNotWhatCameInOneGo) {
  ASSERT_TRUE(readers_->open());
  ASSERT_TRUE(hearUntil([&] { return matches(1, 0); }));
  constexpr std::size_t kSent = 21;
  for (std::uint32_t sent = 1; sent <= kSent + 4; ++sent)
    if (sent % 6 != 0) {
      ASSERT_TRUE(manifolds_.write({.hand = HandId{1}, .tick = 2 * sent + 1, .sent = sent}));
    }
  ASSERT_TRUE(hearUntil([&] { return of_each_tick_ == kSent; }));
  EXPECT_NEAR(readers_->takeLoss().value_or(-1.0), 4.0 / 24.0, 1e-9);
}

}  // namespace
}  // namespace tenon::haptic
