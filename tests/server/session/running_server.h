#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include <gtest/gtest.h>

#include "server/session/session_server.h"
#include "tests/server/session/scripted_client.h"
#include "tests/server/session/small_session.h"

namespace tenon::test {

/// A server that runs in a thread of its own.
class RunningServer {
 public:
  explicit RunningServer(session::SessionOptions options, const std::string& scenario = twoHandedScenario())
      : loaded_(smallSession(scenario)) {
    options.domain = ownDomain();
    if (!options.key) options.key = kTestKey;
    auto opened = session::SessionServer::open(loaded_, std::move(options));
    if (!opened) throw std::runtime_error(opened.error().what);
    server_ = std::move(*opened);
    thread_ = std::thread([this] { report_.emplace(server_->run(stop_)); });
  }
  ~RunningServer() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  void stop() { stop_ = true; }
  session::SessionReport end(bool by_stop = true) {
    if (by_stop) stop_ = true;
    thread_.join();
    EXPECT_TRUE(*report_);
    return **report_;
  }
  [[nodiscard]] const session::LoadedScene& loaded() const { return loaded_; }

 private:
  session::LoadedScene loaded_;
  std::unique_ptr<session::SessionServer> server_;
  std::atomic<bool> stop_ = false;
  std::optional<Result<session::SessionReport>> report_;
  std::thread thread_;
};

inline Pose rightHandAt(Tick tick) { return playInput(tick).readings[0].X_WH; }

/// Sends the inputs of the right hand for ticks `from` to `to`, each after the manifold of the one before.
inline void runInLockstep(ScriptedClient& client, Tick from, Tick to) {
  for (Tick tick = from; tick <= to; ++tick) {
    client.sendPose(static_cast<std::uint32_t>(tick), rightHandAt(tick));
    ASSERT_TRUE(client.receivesUntil([&] { return client.newest.tick >= tick; }))
        << "no answer to tick " << tick;
    ASSERT_EQ(client.newest.tick, tick) << "one tick per input";
    ASSERT_EQ(client.newest.answers_seq, tick);
  }
}

}  // namespace tenon::test
