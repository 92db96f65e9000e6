#include "clients/haptic/copy_loader.h"

#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "clients/haptic/scene_copy.h"
#include "idl/record/compression.h"
#include "idl/wire/assets.h"
#include "server/simulation/compiled_scene.h"
#include "tests/server/simulation/small_scene.h"

namespace tenon::haptic {
namespace {

namespace fs = std::filesystem;

/// Two hands, which keep what they are given.
class GivenStation final : public Station {
 public:
  [[nodiscard]] std::vector<std::string> handNames() const override { return {"right", "left"}; }
  [[nodiscard]] Role role() const override { return Role::kTrainee; }
  [[nodiscard]] std::vector<HandDevice> handDevices() const override { return {{"right"}, {"left"}}; }
  [[nodiscard]] Result<void> armDevices() override { return {}; }
  void step(std::uint32_t) noexcept override {}
  void setCopies(SceneCopies&& given) override {
    ++times;
    by = std::this_thread::get_id();
    copies = std::move(given);
  }

  int times = 0;
  std::thread::id by;
  SceneCopies copies;

 protected:
  void begin(std::span<const HandId>) override {}
  void manifoldReceived(const HandManifold&) noexcept override {}
  void armingChanged() noexcept override {}
};

class CopyLoaderTest : public ::testing::Test {
 protected:
  CopyLoaderTest() : source_{.cache = fs::temp_directory_path() / ("copy_" + std::to_string(getpid()))} {}
  ~CopyLoaderTest() override { fs::remove_all(source_.cache); }

  /// What a server has put into the cache: the name of its list.
  std::string sceneHash() const {
    test::SmallScene small;
    const ObjectId ball = small.object("ball", test::pointerShape(), {0.0, 0.0, 0.03});
    small.hand("right", ball);
    const wire::AssetStore store(source_.cache / "assets");
    const auto name = store.put(*record::compress(*simulation::sceneBytes(*small.build())));
    EXPECT_TRUE(name) << name.error().what;
    const std::string list = R"({"version":1,"compiled":")" + *name + R"(","objects":[]})";
    return *store.put({reinterpret_cast<const std::uint8_t*>(list.data()), list.size()});
  }
  static Result<void> awaitOutcome(CopyLoader& loader) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (std::chrono::steady_clock::now() < until) {
      if (auto outcome = loader.takeOutcome()) return *outcome;
      std::this_thread::yield();
    }
    return fail("nothing came");
  }

  SceneSource source_;
  GivenStation station_;
};

// a station may restart while a copy is loaded: its hands are of its own thread alone
TEST_F(CopyLoaderTest, TheStationGetsItsCopiesByTheThreadThatRestartsIt) {
  CopyLoader loader(station_, source_, ForceModelWish::kAuto);
  loader.loadBeside(sceneHash());
  EXPECT_FALSE(loader.loaded());
  const auto outcome = awaitOutcome(loader);
  ASSERT_TRUE(outcome) << outcome.error().what;
  EXPECT_EQ(station_.by, std::this_thread::get_id());
  EXPECT_EQ(station_.copies.size(), 2U);
  EXPECT_TRUE(loader.loaded());
  EXPECT_FALSE(loader.takeOutcome());
}

TEST_F(CopyLoaderTest, CopiesForANewSeatAreMadeBesideTheSession) {
  CopyLoader loader(station_, source_, ForceModelWish::kSceneCopy);
  loader.renewBeside();
  loader.renew();
  EXPECT_FALSE(loader.takeOutcome()) << "there is no scene";
  ASSERT_TRUE(loader.loadIfAsked(sceneHash(), {}, std::atomic<bool>(false)));
  EXPECT_EQ(station_.times, 1);
  loader.renewBeside();
  EXPECT_EQ(station_.times, 1) << "nothing is made where a station restarts";
  ASSERT_TRUE(awaitOutcome(loader));
  EXPECT_EQ(station_.times, 2);
  EXPECT_EQ(station_.copies.size(), 2U);
  loader.renew();
  EXPECT_EQ(station_.times, 3) << "in lockstep at once";
}

TEST_F(CopyLoaderTest, ASceneThatIsNotThereIsNotLookedForAgain) {
  CopyLoader loader(station_, source_, ForceModelWish::kAuto);
  loader.loadBeside("nothing");
  EXPECT_FALSE(awaitOutcome(loader));
  loader.loadBeside("nothing");
  EXPECT_FALSE(loader.takeOutcome());
  EXPECT_EQ(station_.times, 0);
}

}  // namespace
}  // namespace tenon::haptic
