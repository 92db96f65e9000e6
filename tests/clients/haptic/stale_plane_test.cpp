#include <algorithm>

#include <gtest/gtest.h>

#include "tests/clients/haptic/hand_above_floor.h"

// A fifth body, which the manifold's table of bodies has no place for, jumps from above a hand to below it.
// The manifold that lists its contact is there, the frame with its pose is not:
//
//   ======= its last frame          o  hand
//      o    hand                    ======= where it is

namespace tenon::haptic {
namespace {

constexpr double kHandHeight = 0.03;  // [m]

/// A sigma.7 in the air, with its soft start behind it; frames say that the body is 20 mm above the hand.
struct HandBelowABody : test::HandAboveFloor {
  HandBelowABody() : HandAboveFloor("sigma7-sim") {
    server.floor_height = kHandHeight + 0.02;
    for (int i = 0; i < 3000; ++i) rest(true, false);
  }
  /// One cycle; `frame`: the world's frame comes; `contact`: the manifold lists the body.
  void rest(bool frame, bool contact) {
    intend(Vector3(0.0, 0.0, kHandHeight));
    HandManifold answer = server.manifold(tick, hand.pose());
    if (!contact) {
      answer.contacts.clear();
      answer.X_WO = hand.pose();
    }
    if (frame) world.receive(server.frame(tick));
    hand.receive(answer);
    cycle();
  }
  void jump(double floor_height) {
    server.floor_height = floor_height;
    ++server.floor_epoch;
  }
};

TEST(ForceOfAStalePlane, ABodyWhoseJumpIsInNoFrameYetPushesNobody) {
  HandBelowABody setup;
  ASSERT_LT(setup.force(), 0.01);
  setup.jump(-0.05);
  for (int i = 0; i < 15; ++i) {
    setup.rest(false, true);
    ASSERT_LT(setup.force(), 0.01) << i << " ms";
  }
  for (int i = 0; i < 500; ++i) {
    setup.rest(true, true);
    ASSERT_LT(setup.force(), 0.01) << i << " ms with its frame";
  }
  EXPECT_TRUE(setup.hand.local().usable(setup.world));
}

// frames of a link come each 10 ms, and what moves is elsewhere meanwhile
TEST(ForceOfAStalePlane, ABodyThatMovesAsItsContactSaysIsRenderedBetweenItsFrames) {
  HandBelowABody setup;
  constexpr double kSpeed = 0.3;  // [m/s]
  setup.jump(-0.05);
  for (int i = 0; i < 1500; ++i) setup.rest(true, true);
  for (int i = 0; i < 60; ++i) {
    setup.server.floor_height += kSpeed * kTickSeconds;
    HandManifold answer = setup.server.manifold(setup.tick, setup.hand.pose());
    answer.contacts[0].velocity_W = Vector3f(0.0F, 0.0F, static_cast<float>(kSpeed));
    if (i % 10 == 0) setup.world.receive(setup.server.frame(setup.tick));
    setup.hand.receive(answer);
    setup.cycle();
    ASSERT_TRUE(setup.hand.local().usable(setup.world)) << i << " ms";
  }
}

}  // namespace
}  // namespace tenon::haptic
