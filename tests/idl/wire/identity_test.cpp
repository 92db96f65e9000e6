#include "idl/wire/identity.h"

#include <cstdlib>
#include <fstream>
#include <functional>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

namespace tenon::wire {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

ProofSubject subject() {
  ProofSubject all{
      .challenge = "c", .session = "s", .server_epoch = 7, .client_guid = "g", .role = Role::kAdmin};
  all.client.guid[0] = 1;
  return all;
}

/// Every way in which a proof could be used for something else.
std::vector<std::function<void(ProofSubject&)>> changes() {
  return {[](ProofSubject& s) { s.challenge = "d"; },
          [](ProofSubject& s) { s.session = "t"; },
          [](ProofSubject& s) { s.server_epoch = 8; },
          [](ProofSubject& s) { s.client_guid = "h"; },
          [](ProofSubject& s) { s.role = Role::kInstructor; },
          [](ProofSubject& s) { s.client.guid[15] = 1; },
          [](ProofSubject& s) {  // the same bytes, divided otherwise
            s.challenge = "";
            s.session = "cs";
          }};
}

TEST(Identity, AProofOfTheKeyIsGoodForItsSubjectAlone) {
  const SharedKey key = SharedKey::random();
  const std::string proof = key.proofOf(subject());
  EXPECT_EQ(proof.size(), 64U);
  EXPECT_TRUE(key.isProof(subject(), proof));
  EXPECT_FALSE(SharedKey::random().isProof(subject(), proof));
  for (const auto& change : changes()) {
    ProofSubject other = subject();
    change(other);
    EXPECT_FALSE(key.isProof(other, proof));
  }
  for (const std::string& wrong :
       {std::string(), std::string("x"), std::string(64, '0'), std::string(64, 'z'), proof + "00"})
    EXPECT_FALSE(key.isProof(subject(), wrong)) << wrong;
}

TEST(Identity, AProofOfASeatIsGoodForItsSubjectAndItsPublicKeyAlone) {
  const SeatKey seat = SeatKey::random();
  const std::string proof = seat.proofOf(subject());
  EXPECT_EQ(proof.size(), 128U);
  EXPECT_EQ(seat.publicKey().size(), 64U);
  EXPECT_NE(seat.publicKey(), hexText(seat.seed)) << "the secret is not on the bus";
  EXPECT_TRUE(SeatKey::isProof(seat.publicKey(), subject(), proof));
  EXPECT_FALSE(SeatKey::isProof(SeatKey::random().publicKey(), subject(), proof));
  EXPECT_FALSE(SeatKey::isProof("", subject(), ""));
  for (const auto& change : changes()) {
    ProofSubject other = subject();
    change(other);
    EXPECT_FALSE(SeatKey::isProof(seat.publicKey(), other, proof));
  }
}

TEST(Identity, ASecretIsTheSameOneAfterItsText) {
  const SeatKey seat = SeatKey::random();
  const auto back = readHexText(hexText(seat.seed));
  ASSERT_TRUE(back);
  EXPECT_EQ(SeatKey{*back}.publicKey(), seat.publicKey());
  EXPECT_FALSE(readHexText("12ab"));
  EXPECT_FALSE(readHexText(std::string(64, 'g')));
}

TEST(Identity, RandomTextsDifferAndSecretsAreTheSameOnlyAsAWhole) {
  const std::string one = randomHex(), other = randomHex();
  EXPECT_EQ(one.size(), 32U);
  EXPECT_NE(one, other);
  EXPECT_TRUE(isSameSecret(one, std::string(one)));
  EXPECT_FALSE(isSameSecret(one, other));
  EXPECT_FALSE(isSameSecret(one, one.substr(1)));
  EXPECT_FALSE(isSameSecret("", one));
}

TEST(Identity, ChallengesDifferByClient) {
  const SharedKey secret = SharedKey::random();
  Origin other;
  other.guid[3] = 1;
  EXPECT_EQ(secret.challengeFor({}, "a"), secret.challengeFor({}, "a"));
  EXPECT_NE(secret.challengeFor({}, "a"), secret.challengeFor({}, "b"));
  EXPECT_NE(secret.challengeFor({}, "a"), secret.challengeFor(other, "a"));
  EXPECT_NE(secret.challengeFor({}, "a"), SharedKey::random().challengeFor({}, "a"));
}

class KeyFile : public ::testing::Test {
 protected:
  KeyFile() {
    fs::remove_all(folder_);
    fs::create_directory(folder_);
  }
  ~KeyFile() override { fs::remove_all(folder_); }
  fs::path folder_ = fs::temp_directory_path() / ("tenon-key-" + std::to_string(getpid()));
};

TEST_F(KeyFile, IsMadeOnceAndReadableByItsOwnerAlone) {
  const fs::path file = folder_ / "key";
  EXPECT_THAT(readKeyFile(file).error().what, HasSubstr("cannot be read"));
  const auto made = readOrMakeKeyFile(file);
  ASSERT_TRUE(made) << made.error().what;
  EXPECT_EQ(*readOrMakeKeyFile(file), *made);
  EXPECT_EQ(*readKeyFile(file), *made);
  struct stat status {};
  ASSERT_EQ(stat(file.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1)
      << "nothing beside it";
}

TEST_F(KeyFile, ThatCannotBeMadeIsAnErrorThatNamesIt) {
  const fs::path file = folder_ / "none" / "key";
  EXPECT_THAT(readOrMakeKeyFile(file).error().what, HasSubstr(file.string() + ": cannot be made"));
}

TEST_F(KeyFile, ThatOthersMayReadOrThatIsNoneIsRefused) {
  const fs::path file = folder_ / "key";
  ASSERT_TRUE(readOrMakeKeyFile(file));
  fs::permissions(file, fs::perms(0640));
  EXPECT_THAT(readKeyFile(file).error().what, HasSubstr("others may read this key"));
  fs::permissions(file, fs::perms(0600));
  std::ofstream(file) << "open sesame\n";
  EXPECT_THAT(readKeyFile(file).error().what, HasSubstr("64 hexadecimal digits"));
}

TEST_F(KeyFile, MayBeAPipeWhichIsNotWaitedForWhenItsWriterHasGone) {
  const fs::path pipe = folder_ / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const int reader = open(pipe.c_str(), O_RDONLY | O_NONBLOCK);  // so that the writer can open it
  {
    std::ofstream writer(pipe);
    writer << std::string(64, 'a') << std::flush;
    EXPECT_TRUE(readKeyFile(pipe));
  }
  close(reader);
}

TEST_F(KeyFile, TheRuntimeFolderIsTheUsersAlone) {
  ASSERT_EQ(setenv("XDG_RUNTIME_DIR", folder_.c_str(), 1), 0);
  const auto folder = runtimeFolder();
  ASSERT_TRUE(folder) << folder.error().what;
  EXPECT_EQ(*folder, folder_ / "tenon");
  EXPECT_EQ(defaultKeyFile(), folder_ / "tenon" / "key");
  fs::permissions(*folder, fs::perms(0755));
  EXPECT_THAT(runtimeFolder().error().what, HasSubstr("mode 0700"));
}

}  // namespace
}  // namespace tenon::wire
