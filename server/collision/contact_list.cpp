#include <algorithm>
#include <array>
#include <limits>

#include "server/collision/pair_query.h"
#include "server/collision/query_kernels.h"

namespace tenon::collision {

double penaltyForce(const Contact& contact, double stiffness) noexcept {
  return std::max(-contact.gap, 0.0) * stiffness * contact.area * (1.0 / kReferenceArea);
}

Wrench penaltyWrench(const PairQueryResult& result, const Vector3& p_WAo, double stiffness) noexcept {
  Wrench F_Ao_W;
  for (const Contact& contact : result.contacts) {
    if (contact.gap >= 0.0) continue;
    const Vector3 f = penaltyForce(contact, stiffness) * contact.n_W;
    F_Ao_W += {f, (contact.p_WP - p_WAo).cross(f)};
  }
  return F_Ao_W;
}

std::size_t selectRepresentatives(const ContactList& contacts, std::span<std::uint32_t> out,
                                  std::size_t given) noexcept {
  // metric: a difference of 1 between unit normals counts as much as the extent of all contacts
  std::size_t chosen = 0;
  std::size_t active = 0;
  Eigen::AlignedBox3d box_W;
  // farthest-point selection: next is the contact with the largest distance to those selected
  std::array<double, kMaxPairContacts> apart2;
  apart2.fill(std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (contacts[i].dormant()) {
      apart2[i] = -1.0;
      continue;
    }
    if (contacts[i].gap < contacts[chosen].gap) chosen = i;
    box_W.extend(contacts[i].p_WP);
    ++active;
  }
  const std::size_t wanted = std::min(out.size(), active);
  if (wanted <= given) return given;
  const double extent2 = std::max(box_W.diagonal().squaredNorm(), 1e-12);

  std::size_t count = 0;
  while (true) {
    if (count < given) chosen = out[count];
    out[count++] = static_cast<std::uint32_t>(chosen);
    if (count == wanted) return count;
    const Contact& last = contacts[chosen];
    apart2[chosen] = -1.0;
    std::size_t next = chosen;
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      if (apart2[i] < 0.0) continue;
      const double d2 =
          (contacts[i].p_WP - last.p_WP).squaredNorm() / extent2 + (contacts[i].n_W - last.n_W).squaredNorm();
      apart2[i] = std::min(apart2[i], d2);
      if (apart2[next] < 0.0 || apart2[i] > apart2[next]) next = i;
    }
    chosen = next;
  }
}

}  // namespace tenon::collision
