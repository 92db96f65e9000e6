#include "clients/haptic/answer_readers.h"

#include <chrono>

#include "idl/types/messages/contacts.h"

namespace tenon::haptic {

namespace {

std::int64_t readerTimeNs() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

}  // namespace

std::optional<double> AnswerReaders::takeLoss() {
  const std::optional<double> slow = slow_loss_.take(), each_tick = loss_.take();
  const bool of_slow = (slow_ && slow) || !each_tick;
  return of_slow ? slow : each_tick;
}

Result<void> AnswerReaders::subscribe(bool slow) {
  wire::Inbox& inbox = link_.inbox();
  heard_.assign(1 + link_.member().hands().size(), {});
  slow_ = slow;
  auto subscribed =
      inbox.on<WorldFrame>(link_.member().session(), slow ? wire::kWorldFrame100 : wire::kWorldFrame1k,
                           [this, slow](const WorldFrame& frame) {
                             hear(0, slow);
                             callbacks_.frame(frame);
                           });
  std::size_t index = 0;
  for (wire::Partition& hand : link_.member().hands()) {
    if (!subscribed) break;
    subscribed = inbox.on<HandManifold>(
        hand, slow ? wire::kHandManifold50 : wire::kHandManifold,
        [this, slow, at = ++index](const HandManifold& manifold) {
          hear(at, slow);
          (slow ? slow_loss_ : loss_).received(manifold.hand, manifold.sent, readerTimeNs());
          callbacks_.manifold(manifold);
        });
  }
  return subscribed;
}

void AnswerReaders::close(bool slow) {
  wire::Inbox& inbox = link_.inbox();
  inbox.end(link_.member().session(), (slow ? wire::kWorldFrame100 : wire::kWorldFrame1k).name);
  for (wire::Partition& hand : link_.member().hands())
    inbox.end(hand, (slow ? wire::kHandManifold50 : wire::kHandManifold).name);
}

Result<void> AnswerReaders::choose(bool slow) {
  if (has_both_ && slow != slow_) {  // the former ones hear
    close(slow_);
    slow_ = slow;
    has_both_ = false;
  } else if (has_both_ && (newestHear() || ++calls_ >= kMostCalls)) {
    close(!slow_);
    has_both_ = false;
  }
  if (has_both_ || slow == slow_) return {};
  calls_ = 0;
  if (auto subscribed = subscribe(slow); !subscribed) {
    close(slow);
    slow_ = !slow;
    return subscribed;
  }
  has_both_ = true;
  return {};
}

}  // namespace tenon::haptic
