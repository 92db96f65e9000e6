#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <string>

#include "server/game_control/state_machine.h"

namespace tenon::game_control {
namespace {

/// Each number of the state is one 64-bit word when hashed, saved and restored.
template <typename Number>
std::uint64_t toWord(const Number& number) {
  if constexpr (std::same_as<Number, double>) {
    return std::bit_cast<std::uint64_t>(number);
  } else {
    return static_cast<std::uint64_t>(number);
  }
}

template <typename Number>
void fromWord(std::uint64_t word, Number& number) {
  if constexpr (std::same_as<Number, double>) {
    number = std::bit_cast<double>(word);
  } else if constexpr (std::same_as<Number, bool>) {
    number = word != 0;
  } else {
    number = static_cast<Number>(word);
  }
}

}  // namespace

template <typename Visitor>
void StateMachine::visitMemory(Memory& memory, Visitor&& visit) {
  StepStatus& status = memory.status;
  visit(status.revision);
  visit(status.step);
  visit(status.phase);
  visit(status.hand.value);
  visit(status.started);
  visit(status.changed);
  visit(status.tick);
  visit(status.finished);
  visit(status.failed);
  visit(status.position_error);
  visit(status.angle_error);
  visit(status.contact_seconds);
  for (StateSet* set : {&memory.skipped, &memory.timed_out, &memory.visited})
    for (std::uint64_t& states : *set) visit(states);
  memory.progress.visitMemory(visit);
  visit(status.elapsed);
  visit(memory.contact_ticks);
  visit(memory.regrabs.front().contact_ticks);
  visit(memory.regrabs.front().apart_ticks);
  for (ContactTimer& timer : memory.helpers) {
    visit(timer.contact_ticks);
    visit(timer.apart_ticks);
  }
}

template <typename Visitor>
void StateMachine::visitOtherRegrabs(Memory& memory, Visitor&& visit) {
  for (std::size_t i = 1; i < memory.regrabs.size(); ++i) {
    visit(memory.regrabs[i].contact_ticks);
    visit(memory.regrabs[i].apart_ticks);
  }
}

/// Of the timers that most scenarios do not use only those that run are added.
void StateMachine::addTo(StateHash& hash) const noexcept {
  Memory copy = memory_;
  visitMemory(copy, [&hash](const auto& number) { hash.add(toWord(number)); });
  std::uint64_t timer = 0;
  visitOtherRegrabs(copy, [&](const auto& number) {
    ++timer;
    if (number != 0) hash.add(timer), hash.add(toWord(number));
  });
}

std::vector<std::uint8_t> StateMachine::save() const {
  std::vector<std::uint8_t> bytes;
  append(bytes);
  return bytes;
}

void StateMachine::append(std::vector<std::uint8_t>& bytes) const {
  Memory copy = memory_;
  const auto add = [&bytes](const auto& number) {
    const std::uint64_t word = toWord(number);
    for (unsigned shift = 0; shift < 64; shift += 8)
      bytes.push_back(static_cast<std::uint8_t>(word >> shift));
  };
  visitMemory(copy, add);
  visitOtherRegrabs(copy, add);
}

std::vector<std::size_t> StateMachine::savedDoubles() const {
  Memory copy = memory_;
  std::vector<std::size_t> positions;
  std::size_t words = 0;
  visitMemory(copy, [&]<typename Number>(const Number&) {
    if constexpr (std::same_as<Number, double>) positions.push_back(words * sizeof(std::uint64_t));
    ++words;
  });
  return positions;
}

Result<void> StateMachine::restore(std::span<const std::uint8_t> bytes) {
  Memory memory;
  std::size_t words = 0;
  visitMemory(memory, [&words](const auto&) { ++words; });
  visitOtherRegrabs(memory, [&words](const auto&) { ++words; });
  if (bytes.size() != words * sizeof(std::uint64_t)) {
    return fail("state machine: a saved state has " + std::to_string(words * sizeof(std::uint64_t)) +
                " bytes, this one has " + std::to_string(bytes.size()));
  }
  std::size_t at = 0;
  bool finite = true;
  const auto take = [&]<typename Number>(Number& number) {
    std::uint64_t word = 0;
    for (unsigned shift = 0; shift < 64; shift += 8) word |= std::uint64_t{bytes[at++]} << shift;
    fromWord(word, number);
    if constexpr (std::same_as<Number, double>) finite = finite && std::isfinite(number);
  };
  visitMemory(memory, take);
  visitOtherRegrabs(memory, take);
  if (!finite) return fail("state machine: a saved state contains a number that is not finite");
  if (memory.status.step >= scenario_->states.size() || memory.status.phase > StepPhase::kSkipped) {
    return fail("state machine: a saved state is at step " + std::to_string(memory.status.step) +
                ", but the scenario has " + std::to_string(scenario_->states.size()));
  }
  // a state that has ended is followed by the next one, unless the run is over
  const bool ended = memory.status.phase != StepPhase::kWaiting && memory.status.phase != StepPhase::kActive;
  if (ended && !memory.status.finished && !memory.status.failed &&
      memory.status.step + 1 == scenario_->states.size())
    return fail("state machine: a saved state continues after the scenario's last step");
  for (std::size_t state = scenario_->states.size(); state < kMaxStates; ++state)
    for (const StateSet* set : {&memory.skipped, &memory.timed_out, &memory.visited})
      if (((*set)[state / 64] >> (state % 64) & 1U) != 0)
        return fail("state machine: a saved state has an outcome of step " + std::to_string(state) +
                    ", but the scenario has " + std::to_string(scenario_->states.size()));
  memory_ = memory;
  countOutcomes();
  collectReadings();
  return {};
}

}  // namespace tenon::game_control
