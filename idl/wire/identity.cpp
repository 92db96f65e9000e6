#include "idl/wire/identity.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include <fcntl.h>
#include <poll.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

namespace tenon::wire {
namespace {

using Bytes32 = std::array<std::uint8_t, 32>;
static_assert(crypto_auth_KEYBYTES == 32 && crypto_auth_BYTES == 32 && crypto_sign_SEEDBYTES == 32 &&
              crypto_sign_PUBLICKEYBYTES == 32 && crypto_sign_BYTES == 64);
constexpr int kPipeWait = 10000;  // [ms] for a program that asks for a password first

void ready() {
  static const bool is_ready = sodium_init() >= 0;
  if (!is_ready) std::abort();  // no source of random numbers: nothing that follows would be a secret
}

std::string hex(const std::uint8_t* bytes, std::size_t count) {
  std::string text(2 * count + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), bytes, count);
  text.pop_back();
  return text;
}

template <std::size_t N>
bool fromHex(std::string_view text, std::array<std::uint8_t, N>& bytes) {
  std::size_t size = 0;
  return text.size() == 2 * N &&
         sodium_hex2bin(bytes.data(), N, text.data(), text.size(), nullptr, &size, nullptr) == 0 && size == N;
}

/// Each text after its size, so that no two subjects have the same bytes.
std::string messageOf(const ProofSubject& subject) {
  const std::string_view client(reinterpret_cast<const char*>(subject.client.guid.data()),
                                subject.client.guid.size());
  const std::string numbers =
      std::to_string(subject.server_epoch) + "/" + std::to_string(static_cast<std::uint32_t>(subject.role));
  std::string message;
  for (const std::string_view part : {std::string_view("tenon join"), std::string_view(subject.challenge),
                                      std::string_view(subject.session), std::string_view(numbers),
                                      std::string_view(subject.client_guid), client}) {
    message += std::to_string(part.size()) + ":";
    message += part;
  }
  return message;
}

const std::uint8_t* data(const std::string& text) {
  return reinterpret_cast<const std::uint8_t*>(text.data());
}

std::string macOf(const Bytes32& key, const std::string& message) {
  ready();
  Bytes32 mac;
  crypto_auth(mac.data(), data(message), message.size(), key.data());
  return hex(mac.data(), mac.size());
}

Bytes32 randomBytes() {
  ready();
  Bytes32 bytes;
  randombytes_buf(bytes.data(), bytes.size());
  return bytes;
}

std::string reasonOf(const std::filesystem::path& file, const char* what) {
  return file.string() + ": " + what + " (" + std::strerror(errno) + ")";
}

struct PublicAndSecret {
  std::array<std::uint8_t, crypto_sign_PUBLICKEYBYTES> public_key;
  std::array<std::uint8_t, crypto_sign_SECRETKEYBYTES> secret_key;
};

PublicAndSecret keysOf(const Bytes32& seed) {
  ready();
  PublicAndSecret keys;
  crypto_sign_seed_keypair(keys.public_key.data(), keys.secret_key.data(), seed.data());
  return keys;
}

}  // namespace

SharedKey SharedKey::random() { return {randomBytes()}; }
std::string SharedKey::proofOf(const ProofSubject& subject) const { return macOf(bytes, messageOf(subject)); }
bool SharedKey::isProof(const ProofSubject& subject, std::string_view proof) const {
  ready();
  Bytes32 mac;
  const std::string message = messageOf(subject);
  return fromHex(proof, mac) &&
         crypto_auth_verify(mac.data(), data(message), message.size(), bytes.data()) == 0;
}
std::string SharedKey::challengeFor(const Origin& client, std::string_view client_guid) const {
  return macOf(
      bytes,
      messageOf({.challenge = "challenge", .client_guid = std::string(client_guid), .client = client}));
}

SeatKey SeatKey::random() { return {randomBytes()}; }
std::string SeatKey::publicKey() const { return hexText(keysOf(seed).public_key); }
std::string SeatKey::proofOf(const ProofSubject& subject) const {
  const std::string message = messageOf(subject);
  std::array<std::uint8_t, crypto_sign_BYTES> signature;
  crypto_sign_detached(signature.data(), nullptr, data(message), message.size(),
                       keysOf(seed).secret_key.data());
  return hex(signature.data(), signature.size());
}
bool SeatKey::isProof(std::string_view public_key, const ProofSubject& subject, std::string_view proof) {
  ready();
  Bytes32 key;
  std::array<std::uint8_t, crypto_sign_BYTES> signature;
  const std::string message = messageOf(subject);
  return fromHex(public_key, key) && fromHex(proof, signature) &&
         crypto_sign_verify_detached(signature.data(), data(message), message.size(), key.data()) == 0;
}

std::string contentHash(std::span<const std::uint8_t> bytes) {
  ready();
  Bytes32 hash;
  crypto_generichash(hash.data(), hash.size(), bytes.data(), bytes.size(), nullptr, 0);
  return hex(hash.data(), hash.size());
}

std::string randomHex() {
  const Bytes32 bytes = randomBytes();
  return hex(bytes.data(), bytes.size() / 2);
}

bool isSameSecret(std::string_view a, std::string_view b) {
  return a.size() == b.size() && sodium_memcmp(a.data(), b.data(), a.size()) == 0;
}

std::string hexText(const Bytes32& bytes) { return hex(bytes.data(), bytes.size()); }
Result<Bytes32> readHexText(std::string_view text) {
  Bytes32 bytes;
  if (!fromHex(text, bytes)) return fail("is not a key of 64 hexadecimal digits");
  return bytes;
}

Result<std::filesystem::path> runtimeFolder() {
  const std::string uid = std::to_string(getuid());
  const char* const said = std::getenv("XDG_RUNTIME_DIR");
  const std::filesystem::path of_user = "/run/user/" + uid;
  std::error_code ignored;
  std::filesystem::path folder = std::filesystem::temp_directory_path(ignored) / ("tenon-" + uid);
  if (said != nullptr && *said != '\0') {
    folder = std::filesystem::path(said) / "tenon";
  } else if (std::filesystem::is_directory(of_user, ignored)) {
    folder = of_user / "tenon";
  }
  if (mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) return fail(reasonOf(folder, "cannot be made"));
  struct stat status {};
  if (lstat(folder.c_str(), &status) != 0) return fail(reasonOf(folder, "cannot be read"));
  if (!S_ISDIR(status.st_mode) || status.st_uid != getuid() || (status.st_mode & 077U) != 0)
    return fail(folder.string() +
                ": has to be a folder of yours with mode 0700; it will hold the sessions' key");
  return folder;
}

std::filesystem::path defaultKeyFile() {
  const auto folder = runtimeFolder();
  return folder ? *folder / "key" : std::filesystem::path();
}

Result<SharedKey> readKeyFile(const std::filesystem::path& file) {
  const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) return fail(reasonOf(file, "cannot be read"));
  struct stat status {};
  char text[128];
  const bool known = fstat(descriptor, &status) == 0;
  pollfd is_written{descriptor, POLLIN, 0};  // a pipe from another program
  (void)poll(&is_written, 1, kPipeWait);
  const ssize_t size = read(descriptor, text, sizeof text);
  close(descriptor);
  if (!known || size < 0) return fail(reasonOf(file, "cannot be read"));
  if (S_ISREG(status.st_mode) && (status.st_mode & 077U) != 0)
    return fail(file.string() +
                ": others may read this key: chmod 600 it, or delete it and start the server again");
  std::string_view digits(text, static_cast<std::size_t>(size));
  while (!digits.empty() && (digits.back() == '\n' || digits.back() == ' ')) digits.remove_suffix(1);
  const auto bytes = readHexText(digits);
  if (!bytes) return fail(file.string() + ": " + bytes.error().what);
  return SharedKey{*bytes};
}

Result<SharedKey> readOrMakeKeyFile(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) {
    // complete under its name at once: two servers that start together use one key
    const std::filesystem::path made = file.string() + "." + std::to_string(getpid());
    const int descriptor = open(made.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (descriptor < 0) return fail(reasonOf(file, "cannot be made"));
    const std::string text = hexText(SharedKey::random().bytes) + "\n";
    const bool written = write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size());
    close(descriptor);
    if (written && link(made.c_str(), file.c_str()) != 0 && errno != EEXIST) {
      const auto why = fail(reasonOf(file, "cannot be made"));
      unlink(made.c_str());
      return why;
    }
    unlink(made.c_str());
    if (!written) return fail(reasonOf(file, "cannot be written"));
  }
  return readKeyFile(file);
}

}  // namespace tenon::wire
