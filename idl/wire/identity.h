#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "idl/types/messages/role.h"
#include "idl/types/result.h"
#include "idl/wire/origin.h"

/// Who is who: the key of a lab's sessions, the keys of seats, and what proves that somebody has them.
///
/// Neither key is ever on the bus: the server challenges, the client answers with a proof that is good for
/// this challenge, session, server's life, role and DDS participant alone. All binary values are lower-case
/// hex text. This does not stop a program that forges the GUID of another's participant: DDS Security does.
///
/// Threads: any. Real-time: no.
namespace tenon::wire {

/// What a proof is about. Client and server make it of what each of them knows.
struct ProofSubject {
  std::string challenge;  ///< of the server
  std::string session;
  std::uint32_t server_epoch = 0;
  std::string client_guid;
  Role role = Role::kObserver;
  Origin client;  ///< the participant of the client
};

/// The key of the sessions of one user's servers: who has it may be admin or instructor.
struct SharedKey {
  std::array<std::uint8_t, 32> bytes{};

  [[nodiscard]] static SharedKey random();
  [[nodiscard]] std::string proofOf(const ProofSubject& subject) const;
  [[nodiscard]] bool isProof(const ProofSubject& subject, std::string_view proof) const;
  /// What a server challenges this client with; of a key that only the server has.
  [[nodiscard]] std::string challengeFor(const Origin& client, std::string_view client_guid) const;
  bool operator==(const SharedKey&) const = default;
};

/// The secret of a client's seat, and the public key by which the server knows the seat again.
struct SeatKey {
  std::array<std::uint8_t, 32> seed{};

  [[nodiscard]] static SeatKey random();
  [[nodiscard]] std::string publicKey() const;
  [[nodiscard]] std::string proofOf(const ProofSubject& subject) const;
  /// Whether `proof` was made with the secret that belongs to `public_key`.
  [[nodiscard]] static bool isProof(std::string_view public_key, const ProofSubject& subject,
                                    std::string_view proof);
};

/// BLAKE2b of `bytes`, 256 bits: as hard to forge as a key.
[[nodiscard]] std::string contentHash(std::span<const std::uint8_t> bytes);

/// Random, of 128 bits, as 32 digits.
[[nodiscard]] std::string randomHex();
/// Takes equally long wherever two secrets of one length differ.
[[nodiscard]] bool isSameSecret(std::string_view a, std::string_view b);

/// As text in a file, and back; fails for a text that is none.
[[nodiscard]] std::string hexText(const std::array<std::uint8_t, 32>& bytes);
[[nodiscard]] Result<std::array<std::uint8_t, 32>> readHexText(std::string_view text);

/// The user's runtime folder for Tenon: $XDG_RUNTIME_DIR/tenon, else /run/user/UID/tenon, else tenon-UID in
/// the temporary folder. Made with mode 0700; fails when it is another user's or others may enter it.
[[nodiscard]] Result<std::filesystem::path> runtimeFolder();
/// The file of the session's key in the runtime folder; empty when there is no such folder.
[[nodiscard]] std::filesystem::path defaultKeyFile();
/// Fails when the file is not there, is no key, or can be read by others than its owner.
[[nodiscard]] Result<SharedKey> readKeyFile(const std::filesystem::path& file);
/// Reads the key, or makes a new one in a file of mode 0600 when there is none yet.
[[nodiscard]] Result<SharedKey> readOrMakeKeyFile(const std::filesystem::path& file);

}  // namespace tenon::wire
