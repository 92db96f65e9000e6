#include "idl/record/packed_inputs.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <map>
#include <string>
#include <utility>

#include "idl/record/mcap_format.h"

namespace tenon::record {
namespace {

constexpr std::uint8_t kEncapsulation[4] = {0, 1, 0, 0};
constexpr std::uint8_t kVerbatim = 0xFF;  // instead of a count of readings: the bytes are kept as they are
constexpr std::size_t kMostInputs = 100'000;  // of a message; a bound for damaged ones
constexpr std::size_t kMostBytes = 64U << 20U;

// of a reading in TickInput: hand, seq, active, X_WH (position, quaternion), V_WH (linear, angular), buttons
constexpr std::size_t kNumbers = 14;  // seq, then the 13 of pose and velocity
constexpr std::size_t kPosition = 1, kVelocity = 8;
constexpr std::size_t kReadingBytes = 4 + 4 + 1 + 13 * 8 + 4;
constexpr std::size_t kHeadBytes = 8 + 1;  // tick, count of readings
constexpr double kTicksPerSecond = 1000.0;

enum class Predictor : std::uint8_t { kFormer, kLine, kDerivative };

using Numbers = std::array<std::uint64_t, kNumbers>;

/// Of the bits of one number of a hand in its reading `i`.
std::uint64_t predict(const std::vector<Numbers>& all, std::size_t i, std::size_t number, Predictor by) {
  if (i == 0) return 0;
  const std::uint64_t former = all[i - 1][number];
  if (by == Predictor::kLine && i > 1) return 2 * former - all[i - 2][number];
  if (by != Predictor::kDerivative) return former;
  const std::size_t coordinate = kPosition + (number - kVelocity);
  const double step =
      std::bit_cast<double>(all[i][coordinate]) - std::bit_cast<double>(all[i - 1][coordinate]);
  const double velocity = step * kTicksPerSecond;
  // the bits of what is not a number depend on the machine
  return std::isfinite(velocity) ? std::bit_cast<std::uint64_t>(velocity) : former;
}

std::uint64_t zigzag(std::uint64_t difference) { return (difference << 1U) ^ (0 - (difference >> 63U)); }
std::uint64_t unzigzag(std::uint64_t code) { return (code >> 1U) ^ (0 - (code & 1U)); }

/// All first bytes, all second ones, ...
template <typename T>
void putColumn(mcap::FieldWriter& out, const std::vector<T>& values) {
  for (std::size_t byte = 0; byte < sizeof(T); ++byte)
    for (const T value : values) out.put(static_cast<std::uint8_t>(value >> (8 * byte)));
}

/// Empty when there are not so many.
template <typename T>
std::vector<T> getColumn(mcap::FieldReader& in, std::size_t count) {
  const auto bytes = in.take(count * sizeof(T));
  if (!in.ok) return {};
  std::vector<T> values(count, 0);
  for (std::size_t byte = 0; byte < sizeof(T); ++byte)
    for (std::size_t i = 0; i < count; ++i)
      values[i] = static_cast<T>(values[i] | static_cast<T>(T{bytes[byte * count + i]} << (8 * byte)));
  return values;
}

bool mayBeDerivative(std::size_t number) { return number >= kVelocity && number < kVelocity + 3; }

void putNumber(mcap::FieldWriter& out, const std::vector<Numbers>& all, std::size_t number) {
  std::vector<std::uint64_t> best;
  Predictor of_best = Predictor::kFormer;
  std::size_t fewest_bits = SIZE_MAX;
  for (const Predictor by : {Predictor::kFormer, Predictor::kLine, Predictor::kDerivative}) {
    if (by == Predictor::kDerivative && !mayBeDerivative(number)) continue;
    std::vector<std::uint64_t> codes(all.size());
    std::size_t bits = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      codes[i] = zigzag(all[i][number] - predict(all, i, number, by));
      bits += static_cast<std::size_t>(std::bit_width(codes[i]));
    }
    if (bits >= fewest_bits) continue;
    fewest_bits = bits;
    best = std::move(codes);
    of_best = by;
  }
  out.put(static_cast<std::uint8_t>(of_best));
  putColumn(out, best);
}

struct Reading {
  std::uint32_t hand = 0, buttons = 0;
  std::uint8_t active = 0;
  Numbers numbers{};
};

Reading readingAt(const std::uint8_t* bytes) {
  mcap::FieldReader in(std::span(bytes, kReadingBytes));
  Reading reading;
  reading.hand = in.get<std::uint32_t>();
  reading.numbers[0] = in.get<std::uint32_t>();
  reading.active = in.get<std::uint8_t>();
  for (std::size_t i = 1; i < kNumbers; ++i) reading.numbers[i] = in.get<std::uint64_t>();
  reading.buttons = in.get<std::uint32_t>();
  return reading;
}

void put(mcap::FieldWriter& out, const Reading& reading) {
  out.put(reading.hand);
  out.put(static_cast<std::uint32_t>(reading.numbers[0]));
  out.put(reading.active);
  for (std::size_t i = 1; i < kNumbers; ++i) out.put(reading.numbers[i]);
  out.put(reading.buttons);
}

/// kVerbatim when the bytes are not those of a TickInput of this tick.
std::uint8_t readingsOf(const RecordedInput& input) {
  if (input.bytes.size() < kHeadBytes) return kVerbatim;
  mcap::FieldReader in(input.bytes);
  const auto tick = in.get<std::uint64_t>();
  const auto count = in.get<std::uint8_t>();
  const bool has_all = kHeadBytes + count * kReadingBytes <= input.bytes.size();
  return tick == input.tick && has_all ? count : kVerbatim;
}

/// What is packed, number by number.
struct Columns {
  std::vector<std::uint64_t> ticks, hashes;  ///< ticks: steps from the one before
  std::vector<std::uint8_t> counts, active;
  std::vector<std::uint32_t> hands, buttons, rest_sizes;
  std::vector<std::uint8_t> rest;  ///< changes, or all of an input
  std::map<std::uint32_t, std::vector<Numbers>> numbers;

  void add(const RecordedInput& input, Tick before);
};

void Columns::add(const RecordedInput& input, Tick before) {
  ticks.push_back(zigzag(input.tick - before));
  hashes.push_back(input.state_hash);
  counts.push_back(readingsOf(input));
  std::size_t at = counts.back() == kVerbatim ? 0 : kHeadBytes;
  for (std::size_t i = 0; at > 0 && i < counts.back(); ++i, at += kReadingBytes) {
    const Reading reading = readingAt(input.bytes.data() + at);
    hands.push_back(reading.hand);
    active.push_back(reading.active);
    buttons.push_back(reading.buttons);
    numbers[reading.hand].push_back(reading.numbers);
  }
  rest_sizes.push_back(static_cast<std::uint32_t>(input.bytes.size() - at));
  rest.insert(rest.end(), input.bytes.begin() + static_cast<std::ptrdiff_t>(at), input.bytes.end());
}

/// Of each hand in the order of their numbers; false when bytes are missing.
bool getNumbers(mcap::FieldReader& in, std::map<std::uint32_t, std::vector<Numbers>>& of_hands) {
  for (auto& [hand, all] : of_hands) {
    for (std::size_t number = 0; number < kNumbers; ++number) {
      const auto by = static_cast<Predictor>(in.get<std::uint8_t>());
      const auto codes = getColumn<std::uint64_t>(in, all.size());
      if (!in.ok || by > Predictor::kDerivative || (by == Predictor::kDerivative && !mayBeDerivative(number)))
        return false;
      // positions come before the velocities that they predict
      for (std::size_t i = 0; i < all.size(); ++i)
        all[i][number] = unzigzag(codes[i]) + predict(all, i, number, by);
    }
  }
  return true;
}

/// False when bytes are missing or are too many for what a recording has.
bool getColumns(mcap::FieldReader& in, Columns& columns) {
  const auto count = in.get<std::uint32_t>();
  if (!in.ok || count > kMostInputs) return false;
  columns.ticks = getColumn<std::uint64_t>(in, count);
  columns.hashes = getColumn<std::uint64_t>(in, count);
  columns.counts = getColumn<std::uint8_t>(in, count);
  std::size_t readings = 0;
  for (const std::uint8_t of_tick : columns.counts) readings += of_tick == kVerbatim ? 0 : of_tick;
  columns.hands = getColumn<std::uint32_t>(in, readings);
  columns.active = getColumn<std::uint8_t>(in, readings);
  columns.buttons = getColumn<std::uint32_t>(in, readings);
  columns.rest_sizes = getColumn<std::uint32_t>(in, count);
  std::size_t rest = 0;
  for (const std::uint32_t size : columns.rest_sizes) rest += size;
  if (!in.ok || rest > kMostBytes) return false;
  const auto bytes = in.take(rest);
  columns.rest.assign(bytes.begin(), bytes.end());
  for (const std::uint32_t hand : columns.hands) columns.numbers[hand].emplace_back();
  return in.ok && getNumbers(in, columns.numbers) && in.rest.empty();
}

}  // namespace

std::vector<std::uint8_t> encodePackedInputs(std::span<const RecordedInput> inputs) {
  Columns columns;
  Tick before = 0;
  for (const RecordedInput& input : inputs) columns.add(input, std::exchange(before, input.tick));
  mcap::FieldWriter packed;
  packed.put(static_cast<std::uint32_t>(inputs.size()));
  putColumn(packed, columns.ticks);
  putColumn(packed, columns.hashes);
  packed.putBytes(columns.counts);
  putColumn(packed, columns.hands);
  packed.putBytes(columns.active);
  putColumn(packed, columns.buttons);
  putColumn(packed, columns.rest_sizes);
  packed.putBytes(columns.rest);
  for (const auto& [hand, all] : columns.numbers)
    for (std::size_t number = 0; number < kNumbers; ++number) putNumber(packed, all, number);

  mcap::FieldWriter out;
  out.putBytes(kEncapsulation);
  out.put(std::uint64_t{inputs.empty() ? 0 : inputs.front().tick});
  out.put(std::uint64_t{inputs.empty() ? 0 : inputs.back().tick});
  out.put(static_cast<std::uint32_t>(packed.bytes.size()));
  out.putBytes(packed.bytes);
  return std::move(out.bytes);
}

Result<std::vector<RecordedInput>> decodePackedInputs(std::span<const std::uint8_t> bytes) {
  mcap::FieldReader in(bytes);
  in.take(sizeof(kEncapsulation));
  in.get<std::uint64_t>();
  in.get<std::uint64_t>();
  mcap::FieldReader packed(in.take(in.get<std::uint32_t>()));
  Columns columns;
  if (!in.ok || !getColumns(packed, columns))
    return fail(std::to_string(bytes.size()) + " bytes are not a " + std::string(kPackedInputsType));

  std::vector<RecordedInput> inputs(columns.counts.size());
  std::map<std::uint32_t, std::size_t> next;
  std::size_t reading = 0, rest = 0;
  Tick before = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    RecordedInput& input = inputs[i];
    input.tick = before += unzigzag(columns.ticks[i]);
    input.state_hash = columns.hashes[i];
    mcap::FieldWriter out;
    if (columns.counts[i] != kVerbatim) {
      out.put(std::uint64_t{input.tick});
      out.put(columns.counts[i]);
      for (std::size_t k = 0; k < columns.counts[i]; ++k, ++reading) {
        const std::uint32_t hand = columns.hands[reading];
        put(out, {hand, columns.buttons[reading], columns.active[reading],
                  columns.numbers.at(hand)[next[hand]++]});
      }
    }
    out.putBytes(std::span(columns.rest).subspan(rest, columns.rest_sizes[i]));
    rest += columns.rest_sizes[i];
    input.bytes = std::move(out.bytes);
  }
  return inputs;
}

}  // namespace tenon::record
