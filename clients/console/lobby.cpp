#include "clients/console/lobby.h"

#include <algorithm>
#include <iterator>
#include <memory>

#include <nlohmann/json.hpp>

namespace tenon::console {

std::vector<Channel> Lobby::channels() {
  return {{1, "/lobby", "json", "tenon.Lobby", R"({"type":"object"})", "jsonschema", Delivery::kNewest}};
}

void Lobby::add(const SessionAnnounce& announce) {
  const std::pair key{announce.session, announce.server_epoch};
  has_changed_ = true;
  if (sessions_.size() < kMaxSessions || sessions_.contains(key))
    sessions_.insert_or_assign(key, announce);
  else if (unlisted_.size() < kMaxSessions || unlisted_.contains(key))
    unlisted_.insert_or_assign(key, announce);
}

void Lobby::remove(const SessionAnnounce& gone) {
  const std::pair key{gone.session, gone.server_epoch};
  if (sessions_.erase(key) + unlisted_.erase(key) == 0) return;
  has_changed_ = true;
  if (sessions_.size() < kMaxSessions && !unlisted_.empty())
    sessions_.insert(unlisted_.extract(unlisted_.begin()));
}

std::vector<std::string> Lobby::names() const {
  std::vector<std::string> names;
  for (const auto& [key, session] : sessions_)
    if (names.empty() || names.back() != key.first) names.push_back(key.first);
  return names;
}

std::vector<std::string> Lobby::setUnserved(std::set<std::string> names) {
  std::vector<std::string> added;
  std::set_difference(names.begin(), names.end(), unserved_.begin(), unserved_.end(),
                      std::back_inserter(added));
  has_changed_ = has_changed_ || names != unserved_;
  unserved_ = std::move(names);
  return added;
}

std::vector<Publication> Lobby::take(std::int64_t now_ns) {
  if (!std::exchange(has_changed_, false)) return {};
  nlohmann::json list = nlohmann::json::array();
  for (const auto& [key, session] : sessions_)
    list.push_back({{"session", session.session},
                    {"title", session.title},
                    {"host", session.host},
                    {"served", !unserved_.contains(session.session)},
                    {"lockstep", session.lockstep},
                    {"protocol", session.protocol_version}});
  const nlohmann::json json{{"sessions", list}, {"more", !unlisted_.empty()}};
  const std::string text = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return {{1, 0, now_ns, std::make_shared<const std::vector<std::uint8_t>>(text.begin(), text.end())}};
}

}  // namespace tenon::console
