#include "clients/console/certificate.h"

#include <array>
#include <cerrno>
#include <fstream>
#include <system_error>

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include "clients/console/site.h"

namespace tenon::console {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kRemedy = "; `tenon cert` makes a certificate and its key";

/// A key with a passphrase is refused: nobody is there to type it.
int refusePassphrase(char* /*buffer*/, int /*size*/, int /*writes*/, void* is_asked) {
  *static_cast<bool*>(is_asked) = true;
  return 0;
}

Result<void> checkFile(const fs::path& file) {
  std::error_code error;
  if (fs::is_directory(file, error)) return fail(file.string() + ": is a folder");
  if (fs::exists(file, error) && !fs::is_regular_file(file, error))  // reading a pipe may never end
    return fail(file.string() + ": is no regular file");
  errno = 0;
  if (!std::ifstream(file, std::ios::binary)) {
    const std::string why = std::generic_category().message(errno);
    return fail(file.string() + ": " + why + (errno == ENOENT ? std::string(kRemedy) : ""));
  }
  return {};
}

Result<void> checkTime(const X509* certificate, const fs::path& file) {
  const auto words = [](const ASN1_TIME* time) {
    const std::unique_ptr<BIO, decltype(&BIO_free)> text(BIO_new(BIO_s_mem()), BIO_free);
    std::array<char, 64> buffer{};
    ASN1_TIME_print(text.get(), time);
    const int size = BIO_read(text.get(), buffer.data(), buffer.size());
    return std::string(buffer.data(), static_cast<std::size_t>(std::max(0, size)));
  };
  if (X509_cmp_current_time(X509_get0_notBefore(certificate)) > 0)
    return fail(file.string() + ": the certificate is not valid before " +
                words(X509_get0_notBefore(certificate)) + "; is this machine's clock right?");
  if (X509_cmp_current_time(X509_get0_notAfter(certificate)) < 0)
    return fail(file.string() + ": the certificate has expired on " + words(X509_get0_notAfter(certificate)) +
                "; `tenon cert` makes a new one");
  return {};
}

std::vector<std::string> namesOf(const X509* certificate) {
  const std::unique_ptr<GENERAL_NAMES, decltype(&GENERAL_NAMES_free)> all(
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr)),
      GENERAL_NAMES_free);
  std::vector<std::string> names;
  for (int i = 0; all != nullptr && i < sk_GENERAL_NAME_num(all.get()); ++i) {
    const GENERAL_NAME* const name = sk_GENERAL_NAME_value(all.get(), i);
    const ASN1_STRING* const bytes = name->type == GEN_DNS     ? name->d.dNSName
                                     : name->type == GEN_IPADD ? name->d.iPAddress
                                                               : nullptr;
    if (bytes == nullptr) continue;
    const auto* const data = ASN1_STRING_get0_data(bytes);
    const int size = ASN1_STRING_length(bytes);
    if (name->type == GEN_DNS) {
      names.emplace_back(reinterpret_cast<const char*>(data), static_cast<std::size_t>(size));
    } else if (size == 4) {
      std::string address;
      for (int k = 0; k < size; ++k) address += (k > 0 ? "." : "") + std::to_string(data[k]);
      names.push_back(address);
    }
  }
  return names;
}

}  // namespace

Result<Certificate> Certificate::read(const fs::path& certificate, const fs::path& key) {
  for (const fs::path& file : {certificate, key})
    if (auto checked = checkFile(file); !checked) return fail(checked.error().what);
  Certificate read;
  read.context_.reset(SSL_CTX_new(TLS_server_method()), SSL_CTX_free);
  SSL_CTX* const context = read.context_.get();
  if (context == nullptr) return fail("TLS cannot be used: OpenSSL does not begin");
  SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION);
  SSL_CTX_set_options(context, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  bool is_passphrase_asked = false;
  SSL_CTX_set_default_passwd_cb(context, refusePassphrase);
  SSL_CTX_set_default_passwd_cb_userdata(context, &is_passphrase_asked);
  ERR_clear_error();
  const bool has_certificate = SSL_CTX_use_certificate_chain_file(context, certificate.c_str()) == 1;
  const unsigned long first_error = ERR_peek_error();
  ERR_clear_error();
  if (!has_certificate && ERR_GET_LIB(first_error) == ERR_LIB_SSL) {  // too weak a key, for one
    const char* const why = ERR_reason_error_string(first_error);
    return fail(certificate.string() + ": the certificate cannot be used: " + (why != nullptr ? why : "?"));
  }
  if (!has_certificate)
    return fail(certificate.string() + ": is no certificate in PEM form" + std::string(kRemedy));
  if (auto checked = checkTime(SSL_CTX_get0_certificate(context), certificate); !checked)
    return fail(checked.error().what);
  const bool has_key = SSL_CTX_use_PrivateKey_file(context, key.c_str(), SSL_FILETYPE_PEM) == 1;
  const unsigned long key_error = ERR_peek_error();
  ERR_clear_error();
  SSL_CTX_set_default_passwd_cb_userdata(context, nullptr);
  if (is_passphrase_asked)
    return fail(key.string() + ": the key has a passphrase, which nobody is here to type: give one without");
  const bool is_other = ERR_GET_LIB(key_error) == ERR_LIB_X509;  // a key, but not that of the certificate
  if (!has_key && !is_other)
    return fail(key.string() + ": is no private key in PEM form" + std::string(kRemedy));
  if (is_other || SSL_CTX_check_private_key(context) != 1) {
    ERR_clear_error();
    return fail(key.string() + ": is not the key of the certificate " + certificate.string());
  }
  int days = 0, seconds = 0;
  ASN1_TIME_diff(&days, &seconds, nullptr, X509_get0_notAfter(SSL_CTX_get0_certificate(context)));
  read.validity_ = std::chrono::hours(24 * days + seconds / 3600);
  read.names_ = namesOf(SSL_CTX_get0_certificate(context));
  return read;
}

bool Certificate::covers(std::string_view host) const {
  const std::string name(nameOfHost(host));
  X509* const certificate = SSL_CTX_get0_certificate(context_.get());
  if (name.empty()) return false;
  const bool is_bracketed = name.front() == '[' && name.back() == ']';
  const std::string address = is_bracketed ? name.substr(1, name.size() - 2) : name;
  return X509_check_ip_asc(certificate, address.c_str(), 0) == 1 ||
         X509_check_host(certificate, name.data(), name.size(), 0, nullptr) == 1;
}

}  // namespace tenon::console
