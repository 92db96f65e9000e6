#include "clients/console/foxglove_protocol.h"

#include <algorithm>

#include <nlohmann/json.hpp>

namespace tenon::console {

namespace {

/// Of texts that people or other programs made, so maybe not UTF-8.
std::string dump(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::optional<std::uint32_t> number(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number_unsigned()) return std::nullopt;
  const auto value = found->get<std::uint64_t>();
  return value <= 0xFFFFFFFFU ? std::optional(static_cast<std::uint32_t>(value)) : std::nullopt;
}

constexpr std::size_t kMaxWords = 8;
constexpr std::size_t kMostHands = 2;

/// Its text; empty when there is none.
std::string text(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

/// A list of texts; fails when there is none, or not of 1 to `most`.
Result<std::vector<std::string>> texts(const nlohmann::json& object, const char* key, std::size_t most) {
  const auto list = object.find(key);
  if (list == object.end() || !list->is_array() || list->empty() || list->size() > most)
    return fail("a request without a list '" + std::string(key) + "' of 1 to " + std::to_string(most) +
                " texts");
  std::vector<std::string> all;
  for (const nlohmann::json& entry : *list) {
    if (!entry.is_string()) return fail("an entry of '" + std::string(key) + "' that is no text");
    all.push_back(entry.get<std::string>());
  }
  return all;
}

Result<DeskRequest> parseDesk(const nlohmann::json& json, std::string_view op) {
  using Kind = DeskRequest::Kind;
  constexpr std::array<std::pair<std::string_view, Kind>, 5> kKinds{{{"deskSit", Kind::kSit},
                                                                     {"deskLeave", Kind::kLeave},
                                                                     {"deskCommand", Kind::kCommand},
                                                                     {"handTake", Kind::kTakePart},
                                                                     {"handLeave", Kind::kLeaveHands}}};
  const auto* const kind =
      std::find_if(kKinds.begin(), kKinds.end(), [op](const auto& known) { return known.first == op; });
  if (kind == kKinds.end()) return fail("'" + std::string(op.substr(0, 80)) + "' is not offered here");
  const auto id = number(json, "id");
  if (!id || *id == 0) return fail("a request to the desk without a number 'id' from 1");
  DeskRequest request{.kind = kind->second, .id = *id};
  request.role = text(json, "role");
  request.name = text(json, "name");
  request.key = text(json, "key");
  if (request.kind == Kind::kCommand) {
    auto words = texts(json, "words", kMaxWords);
    if (!words) return fail(words.error().what);
    request.words = std::move(*words);
    request.newest_raise = number(json, "newestRaise");
    if (!request.newest_raise && json.contains("newestRaise"))
      return fail("a 'newestRaise' that is no number of a raise");
  }
  if (request.kind == Kind::kTakePart) {
    auto hands = texts(json, "hands", kMostHands);
    if (!hands) return fail(hands.error().what);
    request.hands = std::move(*hands);
  }
  return request;
}

}  // namespace

std::string deskAnswerText(const DeskAnswer& answer) {
  auto commands = nlohmann::json::object();
  for (const auto& [word, kind] : answer.commands)
    commands[word] = kind ? nlohmann::json(static_cast<std::uint32_t>(*kind)) : nlohmann::json();
  return dump({{"op", answer.is_of_hands ? "handAnswer" : "deskAnswer"},
               {"id", answer.id},
               {"accepted", answer.accepted},
               {"text", answer.text},
               {"role", answer.role},
               {"code", answer.code},
               {"commands", std::move(commands)}});
}

std::optional<std::string_view> chooseSubprotocol(std::string_view offered) {
  while (!offered.empty()) {
    std::string_view name = offered.substr(0, offered.find(','));
    offered.remove_prefix(std::min(offered.size(), name.size() + 1));
    name.remove_prefix(std::min(name.size(), name.find_first_not_of(" \t")));
    name = name.substr(0, name.find_last_not_of(" \t") + 1);
    const auto* known = std::find(kSubprotocols.begin(), kSubprotocols.end(), name);
    if (known != kSubprotocols.end()) return *known;
  }
  return std::nullopt;
}

std::string serverInfoText(std::string_view name, std::string_view session_id) {
  return dump({{"op", "serverInfo"},
               {"name", name},
               {"capabilities", nlohmann::json::array()},
               {"metadata", nlohmann::json::object()},
               {"sessionId", session_id}});
}

std::string advertiseText(const std::vector<Channel>& channels) {
  nlohmann::json list = nlohmann::json::array();
  for (const Channel& channel : channels) {
    list.push_back({{"id", channel.id},
                    {"topic", channel.topic},
                    {"encoding", channel.encoding},
                    {"schemaName", channel.schema_name},
                    {"schema", channel.schema},
                    {"schemaEncoding", channel.schema_encoding}});
  }
  return dump({{"op", "advertise"}, {"channels", list}});
}

std::string statusText(StatusLevel level, std::string_view message) {
  return dump({{"op", "status"}, {"level", static_cast<int>(level)}, {"message", message}});
}

std::string heartbeatText() { return dump({{"op", "heartbeat"}}); }

Result<ViewerRequest> parseViewerText(std::string_view text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) return fail("a text that is no JSON object");
  const auto op = json.find("op");
  if (op == json.end() || !op->is_string()) return fail("a request without 'op'");
  ViewerRequest request;
  if (*op == "subscribe") {
    const auto list = json.find("subscriptions");
    if (list == json.end() || !list->is_array()) return fail("'subscribe' without a list 'subscriptions'");
    for (const nlohmann::json& entry : *list) {
      const auto id = number(entry, "id");
      const auto channel = number(entry, "channelId");
      if (!id || !channel) return fail("a subscription without numbers 'id' and 'channelId'");
      request.subscribe.emplace_back(*id, *channel);
    }
    return request;
  }
  if (*op == "unsubscribe") {
    const auto list = json.find("subscriptionIds");
    if (list == json.end() || !list->is_array())
      return fail("'unsubscribe' without a list 'subscriptionIds'");
    for (const nlohmann::json& entry : *list) {
      const auto id = number({{"id", entry}}, "id");
      if (!id) return fail("a subscription id that is no number");
      request.unsubscribe.push_back(*id);
    }
    return request;
  }
  const std::string name = op->get<std::string>();
  if (!name.starts_with("desk") && !name.starts_with("hand"))
    return fail("'" + name.substr(0, 80) + "' is not offered here");
  auto desk = parseDesk(json, name);
  if (!desk) return fail(desk.error().what);
  request.desk = std::move(*desk);
  return request;
}

MessageHeader messageHeader(SubscriptionId subscription, std::int64_t time_ns) {
  MessageHeader header{1};
  for (std::size_t i = 0; i < 4; ++i) header[1 + i] = static_cast<std::uint8_t>(subscription >> (8 * i));
  for (std::size_t i = 0; i < 8; ++i)
    header[5 + i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(time_ns) >> (8 * i));
  return header;
}

}  // namespace tenon::console
