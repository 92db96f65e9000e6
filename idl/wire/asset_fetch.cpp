#include "idl/wire/asset_fetch.h"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <utility>

#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <unistd.h>

namespace tenon::wire {
namespace {

namespace fs = std::filesystem;

constexpr int kSilence = 10'000;                 // [ms]
constexpr int kSlice = 100;                      // [ms] between two looks at `stop`
constexpr std::uint64_t kRange = 16U << 20U;     // [bytes] of a request
constexpr std::uint64_t kMostBytes = 1U << 30U;  // of an asset
constexpr std::size_t kMostHeader = 16U << 10U;  // [bytes]
constexpr std::string_view kNotInRange = "HTTP/1.1 416 ";

struct HttpAddress {
  std::string host, port = "80";
};

Result<HttpAddress> parseAddress(const std::string& url) {
  constexpr std::string_view kScheme = "http://";
  std::string_view rest = url;
  const auto refused = [&] { return fail(url + ": expected http://HOST or http://HOST:PORT"); };
  if (!rest.starts_with(kScheme)) return refused();
  rest.remove_prefix(kScheme.size());
  rest = rest.substr(0, rest.find('/'));
  const std::size_t colon = rest.rfind(':');
  HttpAddress address{std::string(rest.substr(0, colon))};
  if (colon != std::string_view::npos) address.port = std::string(rest.substr(colon + 1));
  if (address.host.empty() || address.port.empty()) return refused();
  return address;
}

class Socket {
 public:
  Socket(int descriptor, const std::atomic<bool>& stop) : descriptor_(descriptor), stop_(stop) {}
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() { ::close(descriptor_); }

  /// Nothing when the time is over, or `stop` is set.
  [[nodiscard]] bool await(short what) const {
    for (int waited = 0; waited < kSilence && !stop_; waited += kSlice) {
      pollfd entry{descriptor_, what, 0};
      if (::poll(&entry, 1, kSlice) > 0) return true;
    }
    return false;
  }
  [[nodiscard]] bool connect(const addrinfo& to) const {
    if (::connect(descriptor_, to.ai_addr, to.ai_addrlen) == 0) return true;
    if (errno != EINPROGRESS || !await(POLLOUT)) return false;
    int error = 0;
    socklen_t size = sizeof error;
    return ::getsockopt(descriptor_, SOL_SOCKET, SO_ERROR, &error, &size) == 0 && error == 0;
  }
  [[nodiscard]] bool send(std::string_view text) const {
    while (!text.empty()) {
      if (!await(POLLOUT)) return false;
      const ssize_t sent = ::send(descriptor_, text.data(), text.size(), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      text.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }
  /// Bytes read; 0: the end; none: nothing came.
  [[nodiscard]] std::optional<std::size_t> receive(char* to, std::size_t most) const {
    if (!await(POLLIN)) return std::nullopt;
    const ssize_t got = ::recv(descriptor_, to, most, 0);
    if (got < 0) return std::nullopt;
    return static_cast<std::size_t>(got);
  }

 private:
  int descriptor_;
  const std::atomic<bool>& stop_;
};

std::unique_ptr<Socket> connectTo(const HttpAddress& address, const std::atomic<bool>& stop) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(address.host.c_str(), address.port.c_str(), &hints, &found) != 0) return nullptr;
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> list(found, ::freeaddrinfo);
  for (const addrinfo* to = found; to != nullptr; to = to->ai_next) {
    const int descriptor = ::socket(to->ai_family, to->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (descriptor < 0) continue;
    auto socket = std::make_unique<Socket>(descriptor, stop);
    if (socket->connect(*to)) return socket;
  }
  return nullptr;
}

/// "bytes 0-99/1234" says 1234.
std::optional<std::uint64_t> totalOf(std::string_view header) {
  constexpr std::string_view kField = "\r\ncontent-range:";
  std::string lower(header);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  const std::size_t field = lower.find(kField);
  if (field == std::string::npos) return std::nullopt;
  const std::size_t slash = lower.find('/', field), end = lower.find('\r', field + 2);
  if (slash == std::string::npos || slash > end) return std::nullopt;
  std::uint64_t total = 0;
  const auto [at, error] = std::from_chars(lower.data() + slash + 1, lower.data() + end, total);
  return error == std::errc() ? std::optional(total) : std::nullopt;
}

/// One program at a time fetches into a folder: what several appended to one file would be no asset.
class FetchLock {
 public:
  /// Waits for the others, or until `stop` is set.
  FetchLock(const fs::path& folder, const std::atomic<bool>& stop)
      : descriptor_(::open((folder / "fetch.lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)) {
    while (descriptor_ >= 0 && !held_ && !stop) {
      held_ = ::flock(descriptor_, LOCK_EX | LOCK_NB) == 0;
      if (!held_ && ::poll(nullptr, 0, kSlice) < 0) break;
    }
  }
  FetchLock(const FetchLock&) = delete;
  FetchLock& operator=(const FetchLock&) = delete;
  ~FetchLock() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  [[nodiscard]] bool held() const { return held_; }

 private:
  int descriptor_;
  bool held_ = false;
};

/// One request: appends to `part` from byte `from` on. Returns the size of the whole asset.
Result<std::uint64_t> appendRange(const HttpAddress& address, std::string_view name, std::uint64_t from,
                                  std::ofstream& part, const FetchProgress& progress,
                                  const std::atomic<bool>& stop) {
  const std::string where = "http://" + address.host + ":" + address.port;
  const auto socket = connectTo(address, stop);
  if (!socket) return fail(where + ": does not answer");
  const std::string request = "GET /assets/" + std::string(name) + " HTTP/1.1\r\nHost: " + address.host +
                              ":" + address.port + "\r\nRange: bytes=" + std::to_string(from) + "-" +
                              std::to_string(from + kRange - 1) + "\r\nConnection: close\r\n\r\n";
  if (!socket->send(request)) return fail(where + ": does not take a request");
  std::string header;
  std::vector<char> buffer(1U << 16U);
  std::uint64_t total = 0, there = from;
  for (bool in_body = false;;) {
    const auto got = socket->receive(buffer.data(), buffer.size());
    if (!got) return fail(where + (stop ? ": stopped" : ": sent nothing for 10 s"));
    if (*got == 0) break;
    std::string_view bytes(buffer.data(), *got);
    if (!in_body) {
      header += bytes;
      const std::size_t end = header.find("\r\n\r\n");
      if (end == std::string::npos && header.size() < kMostHeader) continue;
      const auto size = totalOf(std::string_view(header).substr(0, end));
      if (end == std::string::npos || !header.starts_with("HTTP/1.1 206 ") || !size || *size > kMostBytes)
        return fail(where + ": does not have the asset " + std::string(name) + " (" +
                    header.substr(0, header.find('\r')).substr(0, 60) + ")");
      total = *size;
      in_body = true;
      bytes = std::string_view(header).substr(end + 4);
    }
    const std::uint64_t most = std::min(total, from + kRange);
    bytes = bytes.substr(0, most - there);
    part.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    there += bytes.size();
    if (progress) progress(there, total);
    if (there == most) break;
  }
  part.flush();
  if (!part) return fail("the asset " + std::string(name) + " cannot be kept: its folder cannot be written");
  if (there == from) return fail(where + ": ended the connection");
  return total;
}

}  // namespace

Result<std::vector<std::uint8_t>> fetchAsset(const AssetStore& store, std::string_view name,
                                             const std::string& url, const FetchProgress& progress,
                                             const std::atomic<bool>& stop) {
  auto known = store.get(name);
  if (known || url.empty() || !isAssetName(name)) return known;
  const auto address = parseAddress(url);
  if (!address) return fail(address.error().what);
  const fs::path file = store.fileOf(name), part = file.string() + ".part";
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  const FetchLock lock(file.parent_path(), stop);
  if (!lock.held())
    return fail(stop ? url + ": stopped" : file.parent_path().string() + ": cannot be written");
  // by the program that was waited for
  if (known = store.get(name); known) return known;
  std::uint64_t there = fs::file_size(part, error);
  if (error) there = 0;
  std::ofstream out(part, std::ios::binary | std::ios::app);
  for (std::uint64_t total = there + 1; there < total;) {
    const auto size = appendRange(*address, name, there, out, progress, stop);
    if (!size) {
      // what was kept may be longer than the asset: the next time it begins anew
      if (size.error().what.find(kNotInRange) != std::string::npos) fs::remove(part, error);
      return fail(size.error().what);
    }
    total = *size;
    there = fs::file_size(part, error);
    if (error) return fail(part.string() + ": " + error.message());
  }
  out.close();
  // before it has its name: what is under a name is whole
  std::ifstream in(part, std::ios::binary);
  std::vector<std::uint8_t> bytes(there);
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!in || assetName(bytes) != name) {
    fs::remove(part, error);
    return fail(url + ": what it sends as asset " + std::string(name) + " has another hash");
  }
  fs::rename(part, file, error);
  if (error) return fail(part.string() + ": cannot be renamed: " + error.message());
  return bytes;
}

}  // namespace tenon::wire
