#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/session/session_registry.h"
#include "tests/server/session/small_session.h"

namespace tenon::session {

/// A registry of the small session, and what clients send to it.
class RegistrySession : public ::testing::Test {
 protected:
  Welcome join(const std::string& guid, Role role, std::vector<std::string> hands = {},
               const std::string& seat_key = {}, JoinProofs proofs = {.seat = true, .key = true}) {
    return registry_.join({.client_guid = guid,
                           .name = guid + "'s station",
                           .role = role,
                           .hands = std::move(hands),
                           .seat_key = seat_key.empty() ? "seat of " + guid : seat_key},
                          proofs, 5);
  }
  FixedVector<Change, kMaxChanges> changes() {
    FixedVector<Change, kMaxChanges> taken;
    registry_.takeChanges(taken);
    return taken;
  }
  CommandAck command(ClientId client, CommandKind kind, const std::string& text = {}, double value = 0.0,
                     HandId hand = {}) {
    return registry_.handleCommand({client, ++commands_, kind, hand, text, value});
  }
  static DeviceInput input(ClientId client, HandId hand) {
    DeviceInput all{.hand = hand, .client = client, .server_epoch = kEpoch, .active = true};
    all.sample = {.seq = 9, .X_WH = Pose(Vector3(0.1, 0.2, 0.3)), .buttons = 1};
    return all;
  }

  static constexpr std::uint32_t kEpoch = 77;
  static constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

  LoadedScene loaded_ = test::smallSession();
  SessionRegistry registry_{*loaded_.scenario, kEpoch, false};
  std::uint32_t commands_ = 0;
};

}  // namespace tenon::session
