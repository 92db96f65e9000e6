#include "clients/console/site.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

namespace tenon::console {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

class SiteTest : public testing::Test {
 protected:
  SiteTest() {
    fs::create_directories(folder_ / "page" / "page");
    write(folder_ / "page" / "index.html", "<html>");
    write(folder_ / "page" / "page" / "index-1a2b.js", "code");
    write(folder_ / "secret", "secret");
  }
  ~SiteTest() override { fs::remove_all(folder_); }

  static void write(const fs::path& file, const std::string& text) { std::ofstream(file) << text; }
  /// Also of what is read from a file while it is sent.
  static std::string bodyOf(const Answer& answer) {
    if (!answer.part) return {answer.body.begin(), answer.body.end()};
    std::string text(answer.part->size, '\0');
    std::ifstream in(answer.part->file);
    in.seekg(static_cast<std::streamoff>(answer.part->offset));
    in.read(text.data(), static_cast<std::streamsize>(text.size()));
    return text;
  }

  const fs::path folder_ = fs::temp_directory_path() / ("tenon_site_test_" + std::to_string(getpid()));
  const wire::AssetStore assets_{folder_ / "assets"};
};

TEST_F(SiteTest, ServesThePage) {
  const Site site(folder_ / "page", assets_);
  EXPECT_TRUE(site.hasPage());
  EXPECT_EQ(bodyOf(site.answer("/")), "<html>");
  EXPECT_EQ(bodyOf(site.answer("/?session=demo")), "<html>");
  EXPECT_FALSE(site.answer("/").is_immutable);
  const Answer code = site.answer("/page/index-1a2b.js");
  EXPECT_EQ(bodyOf(code), "code");
  EXPECT_EQ(code.type, "text/javascript; charset=utf-8");
  EXPECT_TRUE(code.is_immutable);
}

TEST_F(SiteTest, NoPathLeadsOutOfIt) {
  const Site site(folder_ / "page", assets_);
  for (const char* target :
       {"/../secret", "/page/../../secret", "/..%2fsecret", "/%2e%2e/secret", "//secret", "/./index.html",
        "/assets/../secret", "/assets/", "/assets/0123", "/assets/../../../../../../etc/passwd", "/page/",
        "secret", "", "/index.html/", "/\\..\\secret", "http://localhost/index.html"}) {
    const Answer answer = site.answer(target);
    EXPECT_EQ(answer.status, 404U) << target;
    EXPECT_EQ(bodyOf(answer).find("secret"), std::string::npos) << target;
  }
}

TEST_F(SiteTest, WithoutThePageItSaysHowToBuildIt) {
  const Site site(folder_ / "missing", assets_);
  EXPECT_FALSE(site.hasPage());
  const Answer answer = site.answer("/");
  EXPECT_EQ(answer.status, 503U);
  EXPECT_NE(bodyOf(answer).find("deploy/setup console"), std::string::npos);
}

TEST_F(SiteTest, ServesAssetsByTheirContent) {
  const Site site(folder_ / "page", assets_);
  const std::string model = "glTF and more";
  const auto name = assets_.put({reinterpret_cast<const std::uint8_t*>(model.data()), model.size()});
  ASSERT_TRUE(name) << name.error().what;
  const Answer answer = site.answer("/assets/" + *name);
  EXPECT_EQ(bodyOf(answer), model);
  EXPECT_EQ(answer.type, "model/gltf-binary");
  EXPECT_TRUE(answer.is_immutable);
  EXPECT_TRUE(answer.body.empty()) << "it is read while it is sent";
  const Answer part = site.answer("/assets/" + *name, "bytes=5-7");
  EXPECT_EQ(part.status, 206U);
  EXPECT_EQ(bodyOf(part), "and");
}

TEST_F(SiteTest, AnAssetIsToBeCheckedOnceUntilItIsWrittenAnew) {
  Site site(folder_ / "page", assets_);
  const std::string model = "glTF and more";
  const auto name = assets_.put({reinterpret_cast<const std::uint8_t*>(model.data()), model.size()});
  ASSERT_TRUE(name) << name.error().what;
  const std::string target = "/assets/" + *name;
  EXPECT_EQ(site.unchecked(target + "?x"), *name);
  site.setChecked(*name, versionOf(assets_.fileOf(*name)));
  EXPECT_FALSE(site.unchecked(target));
  write(assets_.fileOf(*name), "glTF and other");
  EXPECT_EQ(site.unchecked(target), *name);
  for (const char* other :
       {"/", "/recording.mcap", "/assets/", "/assets/../secret", "/assets/000000000000000000000000000000"})
    EXPECT_FALSE(site.unchecked(other)) << other;
}

TEST(Origin, PagesOfThisServerAndPermittedOnesMayConnect) {
  const std::vector<std::string> others{"https://viewer.example"};
  EXPECT_TRUE(isPermittedOrigin("", "localhost:8080", false, {}));
  EXPECT_TRUE(isPermittedOrigin("http://localhost:8080", "localhost:8080", false, {}));
  EXPECT_TRUE(isPermittedOrigin("https://viewer.example", "localhost:8080", false, others));
  EXPECT_TRUE(isPermittedOrigin("https://localhost:8080", "localhost:8080", true, {}));
  EXPECT_FALSE(isPermittedOrigin("http://localhost:8080", "localhost:8080", true, {}))
      << "changed on its way";
  for (const char* origin :
       {"http://localhost:8081", "https://localhost:8080", "http://localhost", "null", "http://evil.example",
        "http://localhost:8080.evil.example", "https://viewer.example.evil"})
    EXPECT_FALSE(isPermittedOrigin(origin, "localhost:8080", false, others)) << origin;
}

TEST(Handshake, ItsKeyIs16BytesInBase64) {
  EXPECT_TRUE(isHandshakeKey("dGhlIHNhbXBsZSBub25jZQ==")) << "that of RFC 6455";
  for (const char* key : {"", "abc", "dGhlIHNhbXBsZSBub25jZQ", "dGhlIHNhbXBsZSBub25jZQ=",
                          "dGhlIHNhbXBsZSBub25jZR==", "dGhlIHNhbXBsZSBub25j Q==", "dGhlIHNhbXBsZSBub25jZWVl"})
    EXPECT_FALSE(isHandshakeKey(key)) << key;
}

TEST(Host, LocalhostHasNoCase) {
  for (const char* host : {"localhost", "LOCALHOST:8080", "LocalHost"})
    EXPECT_TRUE(isLoopbackHost(host)) << host;
  for (const char* host : {"localhost.evil.example", "localhos", "", "LOCALHOST1"})
    EXPECT_FALSE(isLoopbackHost(host)) << host;
}

TEST(Policy, LetsThePageReadRecordingsOfTheServersThatAreNamed) {
  EXPECT_THAT(contentSecurityPolicy({}), HasSubstr("connect-src 'self' blob:;"));
  EXPECT_THAT(contentSecurityPolicy({"https://files.example", "http://localhost:9000"}),
              HasSubstr("connect-src 'self' blob: https://files.example http://localhost:9000;"));
  for (const char* origin : {"https://files.example", "http://localhost:9000", "https://192.168.1.5:8443"})
    EXPECT_TRUE(isOrigin(origin)) << origin;
  for (const char* origin :
       {"", "files.example", "https://", "https://files.example/", "https://a.b; script-src *", "https://*",
        "https://a:b", "ftp://files.example", "https://a b"})
    EXPECT_FALSE(isOrigin(origin)) << origin;
}

TEST(Host, NamesThisMachineOnly) {
  for (const char* host : {"localhost", "localhost:8080", "127.0.0.1:1", "[::1]", "[::1]:8080"})
    EXPECT_TRUE(isLoopbackHost(host)) << host;
  for (const char* host : {"", "evil.example", "evil.example:8080", "localhost.evil.example",
                           "localhost:", "localhost:80a", "127.0.0.1.evil", "::1", "localhost:80:80"})
    EXPECT_FALSE(isLoopbackHost(host)) << host;
}

TEST(Host, AnAddressIsNoName) {
  for (const char* host : {"192.168.7.5", "192.168.7.5:8080", "[fd00::5]", "[fd00::5]:8080"})
    EXPECT_TRUE(isAddress(host)) << host;
  for (const char* host : {"", "localhost", "5.evil.example", "192.168.7.5.evil:80", "fd00::5", "1.2.3.4:x"})
    EXPECT_FALSE(isAddress(host)) << host;
}

TEST_F(SiteTest, ServesARecordingWholeAndByRanges) {
  const fs::path file = folder_ / "a.mcap";
  std::ofstream(file) << "0123456789";
  Site site(folder_ / "none", wire::AssetStore(folder_));
  EXPECT_EQ(site.answer("/recording.mcap", "bytes=0-3").status, 404U) << "there is none yet";
  EXPECT_FALSE(site.serveRecording(folder_ / "other.mcap"));
  EXPECT_FALSE(site.serveRecording(folder_));
  ASSERT_TRUE(site.serveRecording(file));
  const Answer part = site.answer("/recording.mcap?x", "bytes=2-4");
  EXPECT_EQ(part.status, 206U);
  EXPECT_EQ(bodyOf(part), "234");
  const std::pair<std::string, std::string> range{"Content-Range", "bytes 2-4/10"};
  EXPECT_NE(std::find(part.headers.begin(), part.headers.end(), range), part.headers.end());
  const Answer whole = site.answer("/recording.mcap");
  EXPECT_EQ(whole.status, 200U);
  EXPECT_EQ(bodyOf(whole), "0123456789");
  EXPECT_EQ(site.answer("/recording.mcap", "bytes=10-20").status, 416U);
  constexpr std::uint64_t kLarge = 5ULL << 30U;
  fs::resize_file(file, kLarge);
  const Answer large = site.answer("/recording.mcap");
  EXPECT_EQ(large.status, 200U);
  EXPECT_EQ(large.part->size, kLarge);
  EXPECT_TRUE(large.body.empty()) << "it is read while it is sent";
}

TEST_F(SiteTest, ServesTheRestOfARecordingAndItsLastBytes) {
  const fs::path file = folder_ / "a.mcap";
  std::ofstream(file) << "0123456789";
  Site site(folder_ / "none", wire::AssetStore(folder_));
  ASSERT_TRUE(site.serveRecording(file));
  const auto contentRange = [](const Answer& answer) {
    for (const auto& [name, value] : answer.headers)
      if (name == "Content-Range") return value;
    return std::string();
  };
  for (const auto& [range, status, body, said] : {std::tuple{"bytes=7-", 206U, "789", "bytes 7-9/10"},
                                                  {"bytes=-2", 206U, "89", "bytes 8-9/10"},
                                                  {"bytes=10-", 416U, "", "bytes */10"},
                                                  {"bytes=0-1,3-4", 200U, "0123456789", ""},
                                                  {"lines=0-1", 200U, "0123456789", ""}}) {
    const Answer answer = site.answer("/recording.mcap", range);
    EXPECT_EQ(answer.status, status) << range;
    EXPECT_EQ(bodyOf(answer), body) << range;
    EXPECT_EQ(contentRange(answer), said) << range;
  }
}

TEST(Range, BeginsInTheFileAndEndsWithItAtMost) {
  const auto expect = [](const char* range, std::uint64_t size, FileRange expected) {
    const FileRange part = parseRange(range, size);
    EXPECT_EQ(std::tuple(part.status, part.offset, part.size),
              std::tuple(expected.status, expected.offset, expected.size))
        << range;
  };
  expect("bytes=0-9", 10, {206, 0, 10});
  expect("bytes=9-4000", 10, {206, 9, 1});
  expect("bytes=3-", 10, {206, 3, 7});
  expect("bytes=3-99999999999999999999", 10, {206, 3, 7});
  expect("bytes=-3", 10, {206, 7, 3});
  expect("bytes=-30", 10, {206, 0, 10});
  for (const char* behind : {"bytes=10-11", "bytes=10-", "bytes=-0", "bytes=99999999999999999999-"})
    expect(behind, 10, {416, 0, 0});
  for (const char* empty : {"bytes=0-", "bytes=0-0", "bytes=-1"}) expect(empty, 0, {416, 0, 0});
  for (const char* other : {"", "bytes=", "bytes=-", "bytes=5-4", "bytes=0-1,3-4", "bytes=-1,0-1",
                            "lines=0-1", "bytes=0x1-2", "bytes=a-", "bytes=--1"})
    expect(other, 10, {200, 0, 10});
}

TEST(Room, IsTheSessionThatThePathNames) {
  EXPECT_EQ(roomOf("/"), "/live");
  EXPECT_EQ(roomOf("/live?x=1"), "/live");
  EXPECT_EQ(roomOf("/lobby"), "/lobby");
  EXPECT_EQ(roomOf("/live/demo"), "/live/demo");
  EXPECT_EQ(roomOf("/live/a%20b%2Fc"), "/live/a b/c");
  for (const char* odd : {"/live/%", "/live/%2", "/live/%zz"}) EXPECT_EQ(roomOf(odd), odd);
}

}  // namespace
}  // namespace tenon::console
