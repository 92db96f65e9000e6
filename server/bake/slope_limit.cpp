#include "server/bake/slope_limit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "server/bake/parallel.h"

namespace tenon {

namespace {

using Cell = BrickLevel::Cell;
constexpr int kSide = BrickLevel::kSide;
constexpr int kLast = kSide - 1;

/// What the empty ball about one lattice point says about another.
struct Claim {
  Cell at;
  Cell centre;
  int radius = 0;  // [quanta], like `value`
  int value = 0;
};

/// What a ball loses on its way over so many lattice steps. Rounding of samples is no reason to touch them.
int lossOver(const Cell& steps) {
  const double away = std::sqrt(static_cast<double>(steps.squaredNorm()));
  return static_cast<int>(std::ceil(away * DistanceField::kQuantaPerVoxel)) + 1;
}

/// The same between samples of a brick, as rows along x: entry kLast is the row's own middle.
using LossRow = std::array<int, 2 * kSide - 1>;
using LossTable = std::array<std::array<LossRow, kSide>, kSide>;

LossTable lossesInBrick() {
  LossTable table{};
  for (int z = 0; z < kSide; ++z) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = -kLast; x < kSide; ++x) {
        table[static_cast<std::size_t>(z)][static_cast<std::size_t>(y)][static_cast<std::size_t>(x + kLast)] =
            lossOver({x, y, z});
      }
    }
  }
  return table;
}

bool strongerFirst(const Claim& a, const Claim& b) {
  const auto key = [](const Claim& c) {
    return std::tuple(c.at.x(), c.at.y(), c.at.z(), -c.value, c.centre.x(), c.centre.y(), c.centre.z());
  };
  return key(a) < key(b);
}

template <typename Visit>
void visitNeighbours(Visit&& visit) {
  for (int k = 0; k < 27; ++k) {
    if (k != 13) visit(Cell(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
  }
}

bool hasBothSigns(const std::int16_t* samples) {
  const auto [lowest, highest] = std::minmax_element(samples, samples + BrickLevel::kSamples);
  return *lowest < 0 && *highest >= 0;
}

class SlopeLimiter {
 public:
  SlopeLimiter(BrickLevel& level, ParallelWork& work)
      : level_(level), work_(work), raised_(level.nodes(), 0), losses_(lossesInBrick()) {}

  /// Claims in all bricks of neighbours on each other, and of a brick's middle, from which queries bound it.
  [[nodiscard]] std::vector<Claim> claimsOfNeighbours() const {
    return collect([this](std::size_t node, std::vector<Claim>& claims) { claimNeighbours(node, claims); });
  }

  /// Claims of any two samples on each other, in the bricks that something was raised in since the last call.
  [[nodiscard]] std::vector<Claim> claimsWhereRaised() {
    std::vector<Claim> claims = collect([this](std::size_t node, std::vector<Claim>& found) {
      if (raised_[node] != 0) claimAll(node, found);
    });
    std::fill(raised_.begin(), raised_.end(), std::uint8_t{0});
    return claims;
  }

  /// What coarse samples say about the fine ones next to them.
  [[nodiscard]] std::vector<Claim> claimsOf(const BrickLevel& coarse) const {
    return collect([&](std::size_t node, std::vector<Claim>& claims) { claimFrom(coarse, node, claims); });
  }

  /// Grants the strongest claim on each sample, then lets its ball claim the samples around, until none is
  /// left. Rounds and their order depend on the samples alone.
  void grant(std::vector<Claim> claims) {
    std::vector<Claim> granted;
    while (!claims.empty()) {
      std::sort(claims.begin(), claims.end(), strongerFirst);
      granted.clear();
      for (const Claim& claim : claims) {
        if (!granted.empty() && granted.back().at == claim.at) continue;
        granted.push_back(claim);
        level_.setSample(claim.at, static_cast<std::int16_t>(claim.value), raised_);
      }
      claims.clear();
      for (const Claim& claim : granted) {
        visitNeighbours([&](const Cell& aside) {
          const Cell at = claim.at + aside;
          const int value = claim.radius - lossOver(at - claim.centre);
          const std::int16_t* sample = level_.findSample(at);
          if (sample != nullptr && value > *sample) claims.push_back({at, claim.centre, claim.radius, value});
        });
      }
    }
  }

 private:
  template <typename Work>
  [[nodiscard]] std::vector<Claim> collect(Work&& work) const {
    constexpr std::size_t kChunk = 256;
    std::vector<std::vector<Claim>> found((level_.nodes() + kChunk - 1) / kChunk);
    work_.run(found.size(), 4, [&](std::size_t chunk) {
      const std::size_t end = std::min(level_.nodes(), (chunk + 1) * kChunk);
      for (std::size_t node = chunk * kChunk; node < end; ++node) {
        if (level_.slot[node] >= 0) work(node, found[chunk]);
      }
    });
    std::vector<Claim> claims;
    for (const auto& some : found) claims.insert(claims.end(), some.begin(), some.end());
    return claims;
  }

  void claimNeighbours(std::size_t node, std::vector<Claim>& claims) const {
    const std::int16_t* samples = level_.samplesOf(level_.slot[node]);
    if (!hasBothSigns(samples)) return;
    const Cell corner = level_.brickOf(node) * BrickLevel::kVoxels;
    const Cell middle = Cell::Constant(kSide / 2);
    const auto claim = [&](const Cell& at, const Cell& centre) {
      const int radius = samples[BrickLevel::sampleIndex(centre)];
      const int value = radius - lossInBrick(at, centre);
      if (value > samples[BrickLevel::sampleIndex(at)]) {
        claims.push_back({corner + at, corner + centre, radius, value});
      }
    };
    for (int sample = 0; sample < BrickLevel::kSamples; ++sample) {
      const Cell at = BrickLevel::cellOfSample(sample);
      claim(middle, at);
      if (samples[sample] >= 0) continue;
      claim(at, middle);
      visitNeighbours([&](const Cell& aside) {
        const Cell centre = at + aside;
        if ((centre.array() >= 0).all() && (centre.array() < kSide).all()) claim(at, centre);
      });
    }
  }

  void claimAll(std::size_t node, std::vector<Claim>& claims) const {
    const std::int16_t* samples = level_.samplesOf(level_.slot[node]);
    if (!hasBothSigns(samples)) return;
    const Cell corner = level_.brickOf(node) * BrickLevel::kVoxels;
    for (int sample = 0; sample < BrickLevel::kSamples; ++sample) {
      const Cell at = BrickLevel::cellOfSample(sample);
      int best = samples[sample];
      int best_centre = sample;
      for (int row = 0; row < kSide * kSide; ++row) {
        const int* loss = lossesAlong(at, row) + (kLast - at.x());
        const std::int16_t* from = samples + row * kSide;
        int best_of_row = best;
        for (int x = 0; x < kSide; ++x) best_of_row = std::max(best_of_row, from[x] - loss[x]);
        for (int x = 0; best_of_row > best; ++x) {
          if (from[x] - loss[x] != best_of_row) continue;
          best = best_of_row;
          best_centre = row * kSide + x;
        }
      }
      if (best_centre == sample) continue;
      claims.push_back(
          {corner + at, corner + BrickLevel::cellOfSample(best_centre), samples[best_centre], best});
    }
  }

  [[nodiscard]] int lossInBrick(const Cell& at, const Cell& centre) const {
    return lossesAlong(at, centre.z() * kSide + centre.y())[kLast - at.x() + centre.x()];
  }

  [[nodiscard]] const int* lossesAlong(const Cell& at, int row) const {
    const auto z = static_cast<std::size_t>(std::abs(row / kSide - at.z()));
    const auto y = static_cast<std::size_t>(std::abs(row % kSide - at.y()));
    return losses_[z][y].data();
  }

  void claimFrom(const BrickLevel& coarse, std::size_t node, std::vector<Claim>& claims) const {
    const std::int16_t* samples = level_.samplesOf(level_.slot[node]);
    if (*std::min_element(samples, samples + BrickLevel::kSamples) >= 0) return;
    const Cell corner = level_.brickOf(node) * BrickLevel::kVoxels;
    const int cuts = level_.refinement;
    for (int sample = 0; sample < BrickLevel::kSamples; ++sample) {
      if (samples[sample] >= 0) continue;
      const Cell at = corner + BrickLevel::cellOfSample(sample);
      const Cell nearest = (at + Cell::Constant(cuts / 2)) / cuts;
      const std::int16_t* outside = coarse.findSample(nearest);
      if (outside == nullptr || *outside < 0) continue;
      const int radius = *outside * cuts;
      const int value = radius - lossOver(at - nearest * cuts);
      if (value > samples[sample]) claims.push_back({at, nearest * cuts, radius, value});
    }
  }

  BrickLevel& level_;
  ParallelWork& work_;
  std::vector<std::uint8_t> raised_;  // per node
  const LossTable losses_;
};

}  // namespace

void limitSlope(BrickLevel& level, const BrickLevel* coarse, ParallelWork& work) {
  SlopeLimiter limiter(level, work);
  if (coarse != nullptr) limiter.grant(limiter.claimsOf(*coarse));
  std::vector<Claim> claims = limiter.claimsOfNeighbours();
  while (!claims.empty() && !work.cancelled()) {
    limiter.grant(std::move(claims));
    claims = limiter.claimsWhereRaised();
  }
}

}  // namespace tenon
