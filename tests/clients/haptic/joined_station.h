#pragma once

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "clients/haptic/station_link.h"
#include "tests/clients/fake_session.h"

namespace tenon::haptic {

/// A server without objects and the link of a station that has joined it, on one thread.
class JoinedStation : public ::testing::Test {
 protected:
  /// With a seat for `hands`.
  explicit JoinedStation(std::vector<HandId> hands = {})
      : server_(test::ownDomain(), {.objects = 0}, std::move(hands)) {}

  void SetUp() override {
    auto opening = std::async(std::launch::async, [this] {
      return StationLink::open({.domain = test::ownDomain(),
                                .person = "Ada",
                                .role = Role::kTrainee,
                                .timeout = std::chrono::seconds(60)},
                               stop_);
    });
    while (opening.wait_for(std::chrono::milliseconds(0)) != std::future_status::ready)
      server_.serve(std::chrono::milliseconds(20));
    auto opened = opening.get();
    ASSERT_TRUE(opened) << opened.error().what;
    link_ = std::move(*opened);
  }
  /// Dispatches the station's inbox until `done`; false after a minute.
  bool hearUntil(const std::function<bool()>& done) { return test::dispatchUntil(link_->inbox(), done); }
  /// What comes within a while, to see that nothing does.
  void hear() {
    test::dispatchUntil(link_->inbox(), [n = 0]() mutable { return n++ == 10; });
  }

  test::FakeSession server_;
  std::atomic<bool> stop_ = false;
  std::unique_ptr<StationLink> link_;
};

}  // namespace tenon::haptic
