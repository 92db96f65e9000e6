#pragma once

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <utility>
#include <vector>

#include "clients/console/site.h"
#include "clients/console/web_stream.h"

namespace tenon::console {

/// The body of an answer as Boost.Beast sends it: bytes in memory, or a part of a file, of which one piece at
/// a time is read, so that a large file keeps no other connection waiting.
///
/// Threads: one. Real-time: no.
struct AnswerBody {
  static constexpr std::uint64_t kPiece = 64U << 10U;  ///< [bytes]

  class value_type {
   public:
    void hold(std::vector<std::uint8_t> bytes) {
      remaining_ = bytes.size();
      bytes_ = std::move(bytes);
    }
    /// False when the file cannot be read.
    [[nodiscard]] bool open(const FilePart& part) {
      file_.open(part.file, std::ios::binary);
      file_.seekg(static_cast<std::streamoff>(part.offset));
      remaining_ = part.size;
      if (file_) return true;
      file_.close();
      return false;
    }

   private:
    friend struct AnswerBody;
    std::vector<std::uint8_t> bytes_;  ///< all, or the piece that is sent
    std::ifstream file_;
    std::uint64_t remaining_ = 0;  ///< [bytes]
  };

  static std::uint64_t size(const value_type& body) { return body.remaining_; }

  class writer {
   public:
    using const_buffers_type = asio::const_buffer;
    template <bool is_request, class Fields>
    writer(http::header<is_request, Fields>& /*header*/, value_type& body) : body_(body) {}
    void init(beast::error_code& error) { error = {}; }
    /// The next piece, and whether others follow.
    boost::optional<std::pair<const_buffers_type, bool>> get(beast::error_code& error) {
      error = {};
      if (body_.remaining_ == 0) return boost::none;
      if (body_.file_.is_open() && !read()) {
        error = http::error::partial_message;  // it has become shorter
        return boost::none;
      }
      body_.remaining_ -= body_.bytes_.size();
      return {{asio::buffer(body_.bytes_), body_.remaining_ > 0}};
    }

   private:
    bool read() {
      body_.bytes_.resize(std::min(kPiece, body_.remaining_));
      return static_cast<bool>(body_.file_.read(reinterpret_cast<char*>(body_.bytes_.data()),
                                                static_cast<std::streamsize>(body_.bytes_.size())));
    }
    value_type& body_;
  };
};

}  // namespace tenon::console
