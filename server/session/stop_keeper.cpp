#include "server/session/stop_keeper.h"

#include <utility>

#include "server/session/stop_file.h"

namespace tenon::session {

Result<void> StopKeeper::restore() {
  auto kept = readStopFile(file_);
  if (!kept) return fail(kept.error().what);
  truth_ = std::move(*kept);
  for (const auto& [id, stop] : truth_.standing()) writers_.stop.send(stop);
  for (const auto& [id, cleared] : truth_.cleared()) writers_.clear.send(cleared);
  return {};
}

void StopKeeper::keep() {
  if (auto kept = writeStopFile(file_, truth_); !kept && not_kept) not_kept(kept.error().what);
}

void StopKeeper::publish(const EmergencyStop& stop) {
  writers_.stop.send(stop);
  keep();
}

void StopKeeper::clear(const std::string& who, const std::string& reason) {
  const auto standing = truth_.standing();
  for (const auto& [id, stop] : standing) truth_.clear({stop.client_guid, stop.counter, who, reason});
  keep();  // on the disk before anybody hears of it
  for (const auto& [id, stop] : standing) {
    writers_.clear.send(truth_.cleared().at(id));
    (void)writers_.stop.writer->dispose(stop);
  }
}

}  // namespace tenon::session
