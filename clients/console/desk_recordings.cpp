#include "clients/console/desk_recordings.h"

#include <chrono>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "clients/recorder/recorder_program.h"
#include "idl/types/names.h"
#include "idl/types/printable_text.h"

namespace tenon::console {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kFailed = "record_failed";

/// A name of a session as a part of a file's name: one that leads nowhere else.
std::string fileNamePart(std::string name) {
  constexpr std::size_t kMost = 63;  // [bytes]
  for (char& c : name) {
    const bool is_plain =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
    if (!is_plain) c = '_';
  }
  return name.substr(0, kMost);
}

/// The first file of this name that there is not yet.
fs::path freeFile(const fs::path& folder, const std::string& session) {
  const std::string name = fmt::format("{}-{:%Y%m%d-%H%M%S}", fileNamePart(session),
                                       fmt::gmtime(std::chrono::system_clock::now()));
  std::error_code error;
  for (int i = 1;; ++i) {
    fs::path file = folder / (i == 1 ? name + ".mcap" : fmt::format("{}-{}.mcap", name, i));
    if (!fs::exists(file, error)) return file;
  }
}

}  // namespace

/// One recording and its thread.
class DeskRecordings::One {
 public:
  /// Answers the start when the recorder has joined, the stop when the file is complete.
  One(recorder::RecorderOptions options, const Answer& answer, ViewerId viewer, std::uint32_t request)
      : options_(std::move(options)), answer_(answer), asker_(Asker{viewer, request}) {
    options_.report = [this](const std::string&) {
      if (asker_) answer_(asker_->first, {.id = asker_->second, .accepted = true, .text = fileName()});
      asker_.reset();
    };
    thread_ = std::thread([this] { run(); });
  }
  ~One() {
    stop_ = true;
    thread_.join();
  }
  One(const One&) = delete;
  One& operator=(const One&) = delete;

  [[nodiscard]] bool hasEnded() const { return has_ended_; }
  /// False when it has ended, or somebody waits for its end already.
  [[nodiscard]] bool stop(ViewerId viewer, std::uint32_t request) {
    const std::scoped_lock lock(mutex_);
    if (stop_ || has_ended_) return false;
    stopper_ = Asker{viewer, request};
    stop_ = true;
    return true;
  }

 private:
  using Asker = std::pair<ViewerId, std::uint32_t>;

  [[nodiscard]] std::string fileName() const { return options_.file.filename().string(); }
  void run() {
    const auto recorded = recorder::recordSession(options_, stop_);
    const std::scoped_lock lock(mutex_);
    const std::string text = recorded ? fileName() : recorded.error().what;
    for (const auto& waiting : {asker_, stopper_})
      if (waiting)
        answer_(waiting->first, {.id = waiting->second,
                                 .accepted = recorded.has_value(),
                                 .text = printable(text),
                                 .code = std::string(recorded ? "" : kFailed)});
    has_ended_ = true;
  }

  recorder::RecorderOptions options_;
  const Answer& answer_;
  std::optional<Asker> asker_;  ///< of the start, until it is answered; of the thread
  std::mutex mutex_;
  std::optional<Asker> stopper_;
  std::atomic<bool> stop_{false}, has_ended_{false};
  std::thread thread_;
};

DeskRecordings::DeskRecordings(fs::path folder, fs::path assets, std::uint32_t domain, const Answer& answer)
    : folder_(std::move(folder)), assets_(std::move(assets)), domain_(domain), answer_(answer) {}

DeskRecordings::~DeskRecordings() = default;

void DeskRecordings::handle(ViewerId viewer, const std::string& session, const DeskRequest& request) {
  const std::string what = request.words.size() == 2 ? request.words[1] : "";
  if (what == "start") return start(viewer, session, request.id);
  if (what == "stop") return stop(viewer, session, request.id);
  refuse(viewer, request.id, "usage: record start|stop", refusalName(Refusal::kOther));
}

bool DeskRecordings::records(const std::string& session) {
  const std::scoped_lock lock(mutex_);
  const auto one = running_.find(session);
  return one != running_.end() && !one->second->hasEnded();
}

void DeskRecordings::refuse(ViewerId viewer, std::uint32_t request, std::string why,
                            std::string_view code) const {
  answer_(viewer, {.id = request, .text = std::move(why), .code = std::string(code)});
}

void DeskRecordings::start(ViewerId viewer, const std::string& session, std::uint32_t request) {
  if (folder_.empty())
    return refuse(viewer, request,
                  "this console has no folder for recordings: start it with --recordings FOLDER",
                  "record_no_folder");
  if (session.empty()) return refuse(viewer, request, "there is no session yet", "record_none");
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error) return refuse(viewer, request, folder_.string() + ": " + error.message(), kFailed);
  const std::scoped_lock lock(mutex_);
  auto& one = running_[session];
  if (one != nullptr && !one->hasEnded())
    return refuse(viewer, request, "this session is being recorded here already",
                  refusalName(Refusal::kAlready));
  one = std::make_unique<One>(
      recorder::RecorderOptions{
          .file = freeFile(folder_, session), .session = session, .domain = domain_, .assets = assets_},
      answer_, viewer, request);
}

void DeskRecordings::stop(ViewerId viewer, const std::string& session, std::uint32_t request) {
  const std::scoped_lock lock(mutex_);
  const auto one = running_.find(session);
  if (one != running_.end() && one->second->stop(viewer, request)) return;
  refuse(viewer, request, "this console records nothing of this session", refusalName(Refusal::kAlready));
}

}  // namespace tenon::console
