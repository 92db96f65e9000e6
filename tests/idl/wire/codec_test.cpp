#include "idl/wire/codec.h"

#include <fstream>
#include <memory>
#include <set>
#include <sstream>
#include <type_traits>
#include <utility>

#include <gtest/gtest.h>

#include "idl/wire/profiles.h"
#include "tests/idl/wire/random_messages.h"
#include "tests/support/source_folder.h"

namespace tenon::wire {
namespace {

std::string fileText(const std::string& path_from_root) {
  std::ifstream file(test::sourceFolder() / path_from_root);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(Profiles, AreTheFiles) {
  EXPECT_EQ(loopbackConfig(), fileText("deploy/dds/loopback.xml"));
  EXPECT_EQ(lanConfig(), fileText("deploy/dds/lan.xml"));
  EXPECT_EQ(wanConfig(), fileText("deploy/dds/wan.xml"));
}

template <class M>
class Codec : public ::testing::Test {};

#define TENON_COMMA(M) M,
using AllMessages = ::testing::Types<TENON_WIRE_MESSAGES(TENON_COMMA) WorldFrame>;
TYPED_TEST_SUITE(Codec, AllMessages);

TEST(RandomMessages, HaveEveryStatusAndEnumerator) {
  test::RandomMessages random(7);
  std::set<std::uint8_t> statuses;
  std::set<CommandKind> kinds;
  for (int i = 0; i < 1000; ++i) {
    statuses.insert(random.make<ObjectSnapshot>().state.status);
    kinds.insert(random.make<Command>().kind);
  }
  EXPECT_EQ(statuses, (std::set<std::uint8_t>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(kinds.size(), 19U);
  EXPECT_EQ(*kinds.rbegin(), CommandKind::kKick);
}

// Messages have no operator==, so the bytes of a second encoding are compared.
TYPED_TEST(Codec, IsBitEqualAfterEncodingAndDecoding) {
  test::RandomMessages random(1);
  for (int i = 0; i < 200; ++i) {
    const auto message = random.template make<TypeParam>();
    const auto bytes = encode(message);
    ASSERT_TRUE(bytes) << bytes.error().what;
    const auto back = decode<TypeParam>(*bytes);
    ASSERT_TRUE(back) << back.error().what;
    const auto again = encode(*back);
    ASSERT_TRUE(again);
    EXPECT_EQ(*bytes, *again);
  }
}

/// Counts the fields of a C struct that idl/wire/fields.h converts, as a direction of it.
class FieldCounter {
 public:
  [[nodiscard]] std::size_t count() const { return fields_.size(); }

  void operator()(const char*, const auto& c, auto&) { fields_.insert(&c); }
  void status(const char*, const auto& c, auto&) { fields_.insert(&c); }
  void steps(const char*, const auto& c, auto&, double) { fields_.insert(&c); }
  void bytes(const char*, const auto& c, auto&, std::size_t) { fields_.insert(&c); }
  template <class C, class List>
  void list(const char*, const C& c, List& m, std::size_t, auto each) {
    fields_.insert(&c);
    // elements stay, so that the addresses of their fields differ
    const auto element = std::make_shared<std::remove_pointer_t<decltype(C::_buffer)>>();
    elements_.push_back(element);
    m.resize(1);
    each(*this, std::as_const(*element), m[0]);
  }

 private:
  std::set<const void*> fields_;
  std::vector<std::shared_ptr<void>> elements_;
};

template <class M>
inline constexpr std::size_t kFieldCount = 0;
#define TENON_FIELD_COUNT(M, COUNT) \
  template <>                       \
  inline constexpr std::size_t kFieldCount<M> = COUNT;
TENON_WIRE_FIELD_COUNTS(TENON_FIELD_COUNT)
#undef TENON_FIELD_COUNT

TYPED_TEST(Codec, ConvertsEveryFieldOfTheIdl) {
  FieldCounter counter;
  const typename TypeOf<TypeParam>::C sample{};
  TypeParam message;
  fields(counter, sample, message);
  EXPECT_EQ(counter.count(), kFieldCount<TypeParam>);
}

TYPED_TEST(Codec, TheLargestMessageFitsOneSample) {
  test::RandomMessages random(2, true);
  const auto bytes = encode(random.template make<TypeParam>());
  ASSERT_TRUE(bytes) << bytes.error().what;
  EXPECT_LE(bytes->size(), kMaxSampleBytes);
}

TYPED_TEST(Codec, DifferentMessagesHaveDifferentBytes) {
  test::RandomMessages random(3);
  EXPECT_NE(*encode(random.template make<TypeParam>()), *encode(random.template make<TypeParam>()));
}

TYPED_TEST(Codec, RefusesTruncatedBytes) {
  test::RandomMessages random(4, true);
  const auto bytes = encode(random.template make<TypeParam>());
  ASSERT_TRUE(bytes);
  for (std::size_t size = 0; size < bytes->size(); ++size) {
    auto cut = *bytes;
    cut.resize(size);
    if (size > 3) cut[3] = 0;  // padding 0 in the header
    const auto back = decode<TypeParam>(cut);
    const bool only_padding_is_gone = size + ((*bytes)[3] & 3U) >= bytes->size();
    EXPECT_EQ(back.has_value(), only_padding_is_gone && size + ((*bytes)[3] & 3U) == bytes->size()) << size;
  }
}

TYPED_TEST(Codec, AcceptsOrRefusesFlippedBits) {
  test::RandomMessages random(5);
  std::mt19937_64 where(6);
  const auto bytes = encode(random.template make<TypeParam>());
  ASSERT_TRUE(bytes);
  for (int i = 0; i < 5000; ++i) {
    auto bad = *bytes;
    for (int flips = 0; flips < 4; ++flips) {
      const auto bit = where() % (bad.size() * 8);
      bad[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    }
    // a message that is decoded from damaged bytes must be valid: it can be encoded
    if (const auto back = decode<TypeParam>(bad)) {
      const auto again = encode(*back);
      if (again) {
        EXPECT_LE(again->size(), kMaxSampleBytes);
      }
    }
  }
}

TYPED_TEST(Codec, NamesTheTypeInItsError) {
  const auto back = decode<TypeParam>(std::vector<std::uint8_t>{0, 1, 0, 0});
  ASSERT_FALSE(back);
  EXPECT_EQ(back.error().what, "4 bytes are not a " + std::string(typeName<TypeParam>()));
}

TEST(CodecOf, FieldsAreDecodedToTheirMembers) {
  HandManifold m;
  m.hand = HandId{3};
  m.tick = 0x1122334455667788ULL;
  m.X_HO = Pose(Vector3(1, 2, 3), Quaternion(0.5, -0.5, 0.5, -0.5));
  m.F_Ho_W.torque = Vector3(7, 8, 9);
  m.contacts.push_back({.other = ObjectId{5}, .gap = -0.25F});
  const auto back = decode<HandManifold>(*encode(m));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->hand, m.hand);
  EXPECT_EQ(back->tick, m.tick);
  EXPECT_EQ(back->X_HO, m.X_HO);
  EXPECT_EQ(back->F_Ho_W.torque, m.F_Ho_W.torque);
  ASSERT_EQ(back->contacts.size(), 1U);
  EXPECT_EQ(back->contacts[0].other, ObjectId{5});
  EXPECT_EQ(back->contacts[0].gap, -0.25F);
}

TEST(CodecOf, BytesAreXcdr1OfTheStandard) {
  // encapsulation CDR_LE without padding at the end | key uint32 | id | accepted, 3 bytes of alignment |
  // string length 3 including its zero, 1 byte of alignment | refusal
  CommandAck ack;
  ack.client = ClientId{0x01020304};
  ack.id = 7;
  ack.accepted = true;
  ack.reason = "no";
  ack.refusal = Refusal::kNotPermitted;
  const std::vector<std::uint8_t> expected = {0, 1, 0, 0, 4, 3, 2,   1,   7, 0, 0, 0, 1, 0,
                                              0, 0, 3, 0, 0, 0, 'n', 'o', 0, 0, 3, 0, 0, 0};
  EXPECT_EQ(*encode(ack), expected);
}

TEST(CodecOf, ReadsTheOtherByteOrder) {
  const std::vector<std::uint8_t> big_endian = {0, 0, 0, 0, 1, 2, 3,   4,   0, 0, 0, 7, 1, 0,
                                                0, 0, 0, 0, 0, 3, 'n', 'o', 0, 0, 0, 0, 0, 3};
  const auto ack = decode<CommandAck>(big_endian);
  ASSERT_TRUE(ack) << ack.error().what;
  EXPECT_EQ(ack->client, ClientId{0x01020304});
  EXPECT_EQ(ack->id, 7U);
  EXPECT_EQ(ack->reason, "no");
  EXPECT_EQ(ack->refusal, Refusal::kNotPermitted);
}

TEST(CodecOf, ATextThatIsTooLongIsAnErrorThatNamesTheField) {
  SceneObject object;
  object.name = std::string(64, 'x');
  const auto bytes = encode(object);
  ASSERT_FALSE(bytes);
  EXPECT_EQ(bytes.error().what,
            "tenon::SceneObject: 'name' has 64 bytes or entries, only the first 63 can be sent");
}

TEST(CodecOf, AZeroByteInATextIsAnError) {
  EventLog event;
  event.text = std::string("a\0b", 3);
  EXPECT_FALSE(encode(event));
}

TEST(CodecOf, AnUnknownStatusIsAnError) {
  ObjectSnapshot snapshot;
  snapshot.state.status = 6;
  EXPECT_FALSE(decode<ObjectSnapshot>(*encode(snapshot)));
}

}  // namespace
}  // namespace tenon::wire
