#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"

struct ssl_ctx_st;  // OpenSSL's SSL_CTX

namespace tenon::console {

/// With which the gateway proves to browsers who it is: a certificate, followed by those that vouch for it,
/// and its private key, as PEM. For TLS 1.2 and newer.
///
/// Threads: any. Real-time: no.
class Certificate {
 public:
  /// Fails, with the file and the remedy, when one of them is missing, cannot be read, is something else or
  /// has a passphrase, when they do not belong together, and before and after the time for which it is valid.
  [[nodiscard]] static Result<Certificate> read(const std::filesystem::path& certificate,
                                                const std::filesystem::path& key);

  /// Whether it is for this name or address; `host`: as in the header Host, with or without a port.
  [[nodiscard]] bool covers(std::string_view host) const;
  /// The names and IPv4 addresses that it is for, in its order.
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }
  /// How long it is valid from now on.
  [[nodiscard]] std::chrono::hours validity() const { return validity_; }
  /// For TLS; it keeps what is read here.
  [[nodiscard]] ssl_ctx_st* context() const { return context_.get(); }

 private:
  std::shared_ptr<ssl_ctx_st> context_;
  std::vector<std::string> names_;
  std::chrono::hours validity_{0};
};

}  // namespace tenon::console
