#include "devices/drivers/remote_messages.h"

#include <bit>
#include <cmath>
#include <cstring>

#include "idl/types/bytes.h"

namespace tenon::devices {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");

constexpr std::uint16_t kTargetKind = 1;
constexpr std::uint16_t kViewKind = 2;
constexpr double kRemoteUnitTolerance = 0.01;  // [-] of a quaternion's length
constexpr double kLargestGrip = 1.0;           // [m]

/// Fills a message of fixed size; ByteWriter would allocate.
class ViewWriter {
 public:
  explicit ViewWriter(std::uint8_t* at) : at_(at) {}
  template <class T>
  void put(T value) noexcept {
    std::memcpy(at_, &value, sizeof value);
    at_ += sizeof value;
  }
  void put(const Vector3& v) noexcept { put(v.x()), put(v.y()), put(v.z()); }
  void put(const Pose& X) noexcept {
    put(X.translation());
    const Quaternion& q = X.rotation();
    put(q.w()), put(q.x()), put(q.y()), put(q.z());
  }

 private:
  std::uint8_t* at_;
};

}  // namespace

std::optional<RemoteTarget> decodeTarget(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() != kRemoteTargetSize) return std::nullopt;
  ByteReader in(bytes);
  std::uint32_t magic = 0;
  std::uint16_t version = 0, kind = 0;
  in.get(magic), in.get(version), in.get(kind);
  if (magic != kRemoteMagic || version != kRemoteVersion || kind != kTargetKind) return std::nullopt;
  RemoteTarget target;
  in.get(target.seq), in.get(target.buttons);
  std::array<double, 8> v{};
  for (double& number : v) in.get(number);
  const Vector3 place(v[0], v[1], v[2]);
  const Quaternion turn(v[3], v[4], v[5], v[6]);
  // the order of comparisons refuses NaN
  const bool sound = place.norm() <= kRemoteReach && std::abs(turn.norm() - 1.0) <= kRemoteUnitTolerance &&
                     v[7] >= 0.0 && v[7] <= kLargestGrip;
  if (!sound) return std::nullopt;
  target.X_DT = Pose(place, turn.normalized());
  target.grip = v[7];
  return target;
}

std::array<std::uint8_t, kRemoteViewSize> encodeView(const RemoteView& view) noexcept {
  std::array<std::uint8_t, kRemoteViewSize> bytes{};
  ViewWriter out(bytes.data());
  out.put(kRemoteMagic);
  out.put(kRemoteVersion);
  out.put(kViewKind);
  out.put(view.seq);
  const std::uint32_t flags = (view.forces_on ? 1U : 0U) | (view.shown.active ? 2U : 0U) |
                              (view.shown.in_contact ? 4U : 0U) | (view.faulty ? 8U : 0U);
  out.put(flags);
  out.put(view.cycle);
  out.put(view.X_DH);
  out.put(view.shown.X_DS);
  out.put(view.shown.X_DO);
  out.put(view.shown.p_WC);
  out.put(view.F_Ho_D.force);
  out.put(view.F_Ho_D.torque);
  out.put(view.shown.object.value);
  return bytes;
}

}  // namespace tenon::devices
