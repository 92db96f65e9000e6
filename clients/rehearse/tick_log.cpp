#include "clients/rehearse/tick_log.h"

#include <array>
#include <charconv>
#include <cmath>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "clients/rehearse/rehearsal.h"
#include "idl/types/names.h"

namespace tenon::rehearse {
namespace {

void add(std::string& out, double number) {
  if (!std::isfinite(number)) {
    out += "null";
    return;
  }
  std::array<char, 32> digits{};  // the longest double has 24 characters
  out.append(digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), number).ptr);
}

void add(std::string& out, std::string_view text) {
  out += '"';
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (static_cast<unsigned char>(c) < 0x20) {
      out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    } else {
      out += c;
    }
  }
  out += '"';
}

template <std::size_t N>
void add(std::string& out, const std::array<double, N>& numbers) {
  for (std::size_t i = 0; i < N; ++i) {
    out += i == 0 ? '[' : ',';
    add(out, numbers[i]);
  }
  out += ']';
}

void add(std::string& out, const Pose& X) {
  const Vector3& p = X.translation();
  const Quaternion& q = X.rotation();
  add(out, std::array{p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()});
}

void add(std::string& out, const Wrench& F) {
  const Vector3& f = F.force;
  const Vector3& t = F.torque;
  add(out, std::array{f.x(), f.y(), f.z(), t.x(), t.y(), t.z()});
}

/// Ends a list of members or elements, each followed by a comma.
void closeList(std::string& out, char bracket) {
  if (out.back() == ',') out.pop_back();
  out += bracket;
}

}  // namespace

Result<TickLog> TickLog::open(const std::filesystem::path& file, const TickLogOptions& options) {
  TickLog log;
  log.file_ = file;
  log.options_ = options;
  log.stream_.open(file, std::ios::binary | std::ios::trunc);
  if (!log.stream_) return fail(file.string() + ": cannot be written");
  return log;
}

void TickLog::write(const session::SessionSimulation& simulation, const session::TickOutput& output) {
  if (output.tick % options_.every != 0) return;
  line_ = "{\"t\":";
  add(line_, secondsAt(output.tick));
  addHands(simulation, output);
  addObjects(simulation);
  addPairs(simulation, output);
  if (options_.timing) {
    line_ += ",\"compute_us\":";
    add(line_, 1e6 * output.stats.compute_seconds);
    const simulation::Environment::Work& work = simulation.environment().work();
    line_ += fmt::format(",\"work\":{},\"limited_islands\":{}", work.solve_work, work.limited_islands);
  }
  line_ += "}\n";
  stream_ << line_;
}

void TickLog::addHands(const session::SessionSimulation& simulation, const session::TickOutput& output) {
  const auto hands = simulation.environment().hands();
  line_ += ",\"hands\":{";
  for (std::size_t i = 0; i < hands.size(); ++i) {
    if (!output.present[i]) continue;
    add(line_, simulation.scenario().hands[i].name);
    line_ += ":{\"X_WH\":";
    add(line_, hands[i].X_WH);
    line_ += ",\"F_Ho_W\":";
    add(line_, hands[i].F_Ho_W);
    line_ += ",\"object\":";
    const ObjectId object = hands[i].object;
    if (object.valid()) {
      add(line_, simulation.scenario().objects[object.value].name);
    } else {
      line_ += "null";
    }
    line_ += "},";
  }
  closeList(line_, '}');
}

void TickLog::addObjects(const session::SessionSimulation& simulation) {
  const auto objects = simulation.environment().objects();
  line_ += ",\"objects\":{";
  for (std::size_t i = 0; i < objects.size(); ++i) {
    add(line_, std::string_view(simulation.scenario().objects[i].name));
    line_ += ":{\"X_WO\":";
    add(line_, objects[i].X_WO);
    line_ += ",\"status\":";
    add(line_, objectStatusName(objects[i].status));
    line_ += objects[i].in_contact ? ",\"in_contact\":true" : ",\"in_contact\":false";
    line_ += objects[i].asleep ? ",\"asleep\":true}," : ",\"asleep\":false},";
  }
  closeList(line_, '}');
}

void TickLog::addPairs(const session::SessionSimulation& simulation, const session::TickOutput& output) {
  const auto nameOf = [&](ObjectId object) -> std::string_view {
    return simulation.scenario().objects[object.value].name;
  };
  line_ += ",\"pairs\":[";
  for (const session::PairState& pair : output.pairs) {
    line_ += "{\"a\":";
    add(line_, nameOf(pair.contact.a));
    line_ += ",\"b\":";
    add(line_, nameOf(pair.contact.b));
    line_ += ",\"depth\":";
    add(line_, pair.contact.depth);
    line_ += ",\"gap\":";
    add(line_, pair.contact.gap);
    const auto* result = simulation.environment().pairs()[pair.pair].result;
    line_ += fmt::format(",\"dropped\":{}", result != nullptr ? result->query.counts.contacts_dropped : 0U);
    line_ += ",\"F_Ao_W\":";
    add(line_, pair.contact.F_Ao_W);
    line_ += "},";
  }
  closeList(line_, ']');
}

Result<void> TickLog::close() {
  stream_.close();
  if (!stream_) return fail(file_.string() + ": could not be written completely");
  return {};
}

}  // namespace tenon::rehearse
