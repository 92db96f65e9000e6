#include "clients/haptic/answer_readers.h"

namespace tenon::haptic {

Result<void> AnswerReaders::subscribe(bool slow) {
  wire::Inbox& inbox = link_.inbox();
  auto subscribed = inbox.on<WorldFrame>(link_.member().session(),
                                         slow ? wire::kWorldFrame100 : wire::kWorldFrame1k, callbacks_.frame);
  for (wire::Partition& hand : link_.member().hands()) {
    if (!subscribed) break;
    subscribed =
        inbox.on<HandManifold>(hand, slow ? wire::kHandManifold50 : wire::kHandManifold, callbacks_.manifold);
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
  if (has_both_) {
    close(!slow_);
    has_both_ = false;
    return {};
  }
  if (slow == slow_) return {};
  if (auto subscribed = subscribe(slow); !subscribed) return subscribed;
  slow_ = slow;
  has_both_ = true;
  return {};
}

}  // namespace tenon::haptic
