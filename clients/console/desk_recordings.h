#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "clients/console/web_options.h"

namespace tenon::console {

/// Recordings that people at browsers start and stop: of each session one at a time, by a recorder of its own
/// that joins the session, `SESSION-DATE-TIME.mcap` (UTC) in the folder of this gateway.
///
/// Requests have the words `record start` or `record stop`. A start is answered with the file's name when the
/// recorder has joined, or with the reason why it has not; a stop likewise when the file is complete. A
/// recording also ends with its session.
///
/// Threads: any; one of its own for each recording, which calls `answer`. Real-time: no.
class DeskRecordings {
 public:
  using Answer = std::function<void(ViewerId, const DeskAnswer&)>;

  /// `folder` empty: every start is refused; `assets`: of display models. `answer` must outlive this.
  DeskRecordings(std::filesystem::path folder, std::filesystem::path assets, std::uint32_t domain,
                 const Answer& answer);
  /// Completes the files of recordings that run.
  ~DeskRecordings();
  DeskRecordings(const DeskRecordings&) = delete;
  DeskRecordings& operator=(const DeskRecordings&) = delete;

  void handle(ViewerId viewer, const std::string& session, const DeskRequest& request);
  [[nodiscard]] bool records(const std::string& session);

 private:
  class One;

  void start(ViewerId viewer, const std::string& session, std::uint32_t request);
  void stop(ViewerId viewer, const std::string& session, std::uint32_t request);
  /// `code`: of the page's texts; of refusalName(), or one of its own.
  void refuse(ViewerId viewer, std::uint32_t request, std::string why, std::string_view code) const;

  std::filesystem::path folder_, assets_;
  std::uint32_t domain_;
  const Answer& answer_;
  std::mutex mutex_;
  std::map<std::string, std::unique_ptr<One>> running_;  ///< by session; some may have ended
};

}  // namespace tenon::console
