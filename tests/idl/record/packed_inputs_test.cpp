#include "idl/record/packed_inputs.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/types/bytes.h"

namespace tenon::record {
namespace {

using testing::HasSubstr;

/// Bytes as those of a TickInput: `hands` that move evenly, with the velocity of that, and no changes.
RecordedInput movingHands(Tick tick, std::uint32_t hands) {
  RecordedInput input{tick, tick * 0x9E3779B97F4A7C15U, {}};
  ByteWriter out(input.bytes);
  out.put(tick), out.put(static_cast<std::uint8_t>(hands));
  for (std::uint32_t hand = 0; hand < hands; ++hand) {
    const auto at = [&](Tick when) { return 0.1 * hand + 0.3 * std::sin(1e-3 * static_cast<double>(when)); };
    out.put(hand), out.put(static_cast<std::uint32_t>(tick)), out.put(std::uint8_t{1});
    for (int i = 0; i < 3; ++i) out.put(at(tick));
    for (const double part : {0.0, 0.0, 0.0, 1.0}) out.put(part);
    for (int i = 0; i < 3; ++i) out.put((at(tick) - at(tick - 1)) * 1000.0);
    for (int i = 0; i < 3; ++i) out.put(0.0);
    out.put(std::uint32_t{0});
  }
  out.put(std::uint8_t{0});
  return input;
}

TEST(PackedInputs, AreReadAsTheyWere) {
  std::mt19937_64 random(7);
  std::vector<RecordedInput> inputs;
  for (Tick tick = 5; tick < 200; ++tick) {
    RecordedInput input = movingHands(tick, tick % 7 == 0 ? 2 : 3);
    if (tick % 11 == 0) input.bytes.insert(input.bytes.end(), tick, static_cast<std::uint8_t>(tick));
    if (tick % 13 == 0)  // no number at all
      for (std::size_t i = 20; i < 60; ++i) input.bytes[i] = static_cast<std::uint8_t>(random());
    inputs.push_back(std::move(input));
  }
  inputs.push_back({900, 1, {}});
  inputs.push_back({901, 2, {1, 2, 3}});
  inputs.push_back({17, 3, movingHands(18, 3).bytes});  // of another tick than it says
  inputs.push_back(movingHands(2, 0));
  const auto read = decodePackedInputs(encodePackedInputs(inputs));
  ASSERT_TRUE(read) << read.error().what;
  EXPECT_EQ(*read, inputs);
  EXPECT_TRUE(decodePackedInputs(encodePackedInputs({}))->empty());
}

TEST(PackedInputs, OfInfiniteAndUndefinedNumbersAreReadAsTheyWere) {
  std::vector<RecordedInput> inputs;
  for (Tick tick = 1; tick < 9; ++tick) {
    inputs.push_back(movingHands(tick, 1));
    const double odd =
        tick % 2 == 0 ? std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
    for (std::size_t number = 0; number < 13; ++number)
      std::memcpy(inputs.back().bytes.data() + 18 + 8 * number, &odd, sizeof(odd));
  }
  EXPECT_EQ(*decodePackedInputs(encodePackedInputs(inputs)), inputs);
}

// A velocity that is the difference of positions leaves nothing to store but zeros.
TEST(PackedInputs, OfEvenMotionAreMostlyZeros) {
  std::vector<RecordedInput> inputs;
  for (Tick tick = 1; tick <= 250; ++tick) inputs.push_back(movingHands(tick, 3));
  const auto packed = encodePackedInputs(inputs);
  const auto zeros = std::count(packed.begin(), packed.end(), 0);
  EXPECT_GT(static_cast<double>(zeros), 0.8 * static_cast<double>(packed.size()));
}

TEST(PackedInputs, ThatAreCutAreRefusedAndDamageEndsNoReader) {
  std::vector<RecordedInput> inputs;
  for (Tick tick = 1; tick <= 20; ++tick) inputs.push_back(movingHands(tick, 2));
  const auto packed = encodePackedInputs(inputs);
  for (std::size_t size = 0; size < packed.size(); ++size) {
    const auto cut = decodePackedInputs(std::span(packed).first(size));
    ASSERT_FALSE(cut) << size;
    ASSERT_THAT(cut.error().what, HasSubstr("are not a tenon_record::PackedInputs"));
  }
  std::mt19937 random(3);
  for (int i = 0; i < 3000; ++i) {
    auto damaged = packed;
    damaged[random() % 200] = static_cast<std::uint8_t>(random());
    static_cast<void>(decodePackedInputs(damaged));  // ends, whatever it says
  }
}

}  // namespace
}  // namespace tenon::record
