#include "server/bake/slope_limit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "server/bake/parallel.h"

namespace tenon::bake {

namespace {

using Cell = BrickLevel::Cell;
constexpr int kSide = BrickLevel::kSide;
constexpr int kLast = kSide - 1;

/// The lower bound that the empty ball around one lattice point gives for the sample at another.
struct BallBound {
  Cell at;
  Cell centre;
  int radius = 0;  // [quanta], like `value`
  int value = 0;
};

/// [quanta] The decrease of a ball's bound over a lattice offset; one more, so that rounding alone raises no
/// sample.
int decreaseOver(const Cell& offset) {
  const double away = std::sqrt(static_cast<double>(offset.squaredNorm()));
  return static_cast<int>(std::ceil(away * structures::DistanceField::kQuantaPerVoxel)) + 1;
}

/// The same between samples of a brick, as rows along x; offset 0 is at entry kLast.
using DecreaseRow = std::array<int, 2 * kSide - 1>;
using DecreaseTable = std::array<std::array<DecreaseRow, kSide>, kSide>;

DecreaseTable decreasesInBrick() {
  DecreaseTable table{};
  for (int z = 0; z < kSide; ++z) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = -kLast; x < kSide; ++x) {
        table[static_cast<std::size_t>(z)][static_cast<std::size_t>(y)][static_cast<std::size_t>(x + kLast)] =
            decreaseOver({x, y, z});
      }
    }
  }
  return table;
}

/// By sample, the highest bound first; ties by centre.
bool highestFirst(const BallBound& a, const BallBound& b) {
  const auto key = [](const BallBound& c) {
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

/// For each sample of a brick, bit x of row z * kSide + y, whether it or one of its 26 neighbours is not
/// inside.
std::array<std::uint32_t, kSide * kSide> besideOutside(const std::int16_t* samples) {
  std::array<std::uint32_t, kSide * kSide> wide{};
  for (std::size_t row = 0; row < wide.size(); ++row) {
    std::uint32_t outside = 0;
    for (std::size_t x = 0; x < kSide; ++x)
      outside |= static_cast<std::uint32_t>(samples[row * kSide + x] >= 0) << x;
    wide[row] = outside | outside << 1U | outside >> 1U;
  }
  for (const std::size_t stride : {std::size_t{1}, std::size_t{kSide}}) {
    const auto narrow = wide;
    for (std::size_t row = 0; row < wide.size(); ++row) {
      const std::size_t along = row / stride % kSide;
      if (along > 0) wide[row] |= narrow[row - stride];
      if (along + 1 < kSide) wide[row] |= narrow[row + stride];
    }
  }
  return wide;
}

bool hasBothSigns(const std::int16_t* samples) {
  const auto [lowest, highest] = std::minmax_element(samples, samples + BrickLevel::kSamples);
  return *lowest < 0 && *highest >= 0;
}

class SlopeLimiter {
 public:
  SlopeLimiter(BrickLevel& level, ParallelWork& work)
      : level_(level), work_(work), raised_(level.nodes(), 0), decreases_(decreasesInBrick()) {}

  /// Bounds in all bricks: between neighbouring samples, and between every sample and the brick's middle,
  /// from which queries bound the brick.
  [[nodiscard]] std::vector<BallBound> boundsOfNeighbours() const {
    return collect(
        [this](std::size_t node, std::vector<BallBound>& bounds) { boundNeighbours(node, bounds); });
  }

  /// Bounds between any two samples, in the bricks with a sample raised since the last call.
  [[nodiscard]] std::vector<BallBound> boundsWhereRaised() {
    std::vector<BallBound> bounds = collect([this](std::size_t node, std::vector<BallBound>& found) {
      if (raised_[node] != 0) boundAll(node, found);
    });
    std::fill(raised_.begin(), raised_.end(), std::uint8_t{0});
    return bounds;
  }

  /// Bounds from coarse samples for the nearest fine ones.
  [[nodiscard]] std::vector<BallBound> boundsFrom(const BrickLevel& coarse) const {
    return collect(
        [&](std::size_t node, std::vector<BallBound>& bounds) { boundFrom(coarse, node, bounds); });
  }

  /// Applies the highest bound of each sample, then propagates it to the samples around, until no sample
  /// rises. Rounds and their order depend on the samples alone.
  void apply(std::vector<BallBound> bounds) {
    std::vector<BallBound> applied;
    while (!bounds.empty()) {
      std::sort(bounds.begin(), bounds.end(), highestFirst);
      applied.clear();
      for (const BallBound& bound : bounds) {
        if (!applied.empty() && applied.back().at == bound.at) continue;
        applied.push_back(bound);
        level_.setSample(bound.at, static_cast<std::int16_t>(bound.value), raised_);
      }
      bounds.clear();
      for (const BallBound& bound : applied) {
        visitNeighbours([&](const Cell& step) {
          const Cell at = bound.at + step;
          const int value = bound.radius - decreaseOver(at - bound.centre);
          const std::int16_t* sample = level_.findSample(at);
          if (sample != nullptr && value > *sample) bounds.push_back({at, bound.centre, bound.radius, value});
        });
      }
    }
  }

 private:
  template <typename Work>
  [[nodiscard]] std::vector<BallBound> collect(Work&& work) const {
    constexpr std::size_t kChunk = 256;
    std::vector<std::vector<BallBound>> found((level_.nodes() + kChunk - 1) / kChunk);
    work_.run(found.size(), 4, [&](std::size_t chunk) {
      const std::size_t end = std::min(level_.nodes(), (chunk + 1) * kChunk);
      for (std::size_t node = chunk * kChunk; node < end; ++node) {
        if (level_.slot[node] >= 0) work(node, found[chunk]);
      }
    });
    std::vector<BallBound> bounds;
    for (const auto& some : found) bounds.insert(bounds.end(), some.begin(), some.end());
    return bounds;
  }

  void boundNeighbours(std::size_t node, std::vector<BallBound>& bounds) const {
    const std::int16_t* samples = level_.samplesOf(level_.slot[node]);
    if (!hasBothSigns(samples)) return;
    const Cell corner = level_.brickOf(node) * BrickLevel::kVoxels;
    const Cell middle = Cell::Constant(kSide / 2);
    const auto bound = [&](const Cell& at, const Cell& centre) {
      const int radius = samples[BrickLevel::sampleIndex(centre)];
      const int value = radius - decreaseInBrick(at, centre);
      if (value > samples[BrickLevel::sampleIndex(at)]) {
        bounds.push_back({corner + at, corner + centre, radius, value});
      }
    };
    const auto beside_outside = besideOutside(samples);
    for (int sample = 0; sample < BrickLevel::kSamples; ++sample) {
      const Cell at = BrickLevel::cellOfSample(sample);
      bound(middle, at);
      if (samples[sample] >= 0) continue;
      bound(at, middle);
      if ((beside_outside[static_cast<std::size_t>(sample / kSide)] >> static_cast<unsigned>(at.x()) & 1U) ==
          0)
        continue;
      const Cell low = (at - Cell::Ones()).cwiseMax(0);
      const Cell high = (at + Cell::Ones()).cwiseMin(kLast);
      for (int z = low.z(); z <= high.z(); ++z) {
        for (int y = low.y(); y <= high.y(); ++y) {
          for (int x = low.x(); x <= high.x(); ++x) {
            // samples inside are right among each other
            if (samples[BrickLevel::sampleIndex({x, y, z})] >= 0) bound(at, {x, y, z});
          }
        }
      }
    }
  }

  void boundAll(std::size_t node, std::vector<BallBound>& bounds) const {
    const std::int16_t* samples = level_.samplesOf(level_.slot[node]);
    if (!hasBothSigns(samples)) return;
    const Cell corner = level_.brickOf(node) * BrickLevel::kVoxels;
    std::array<int, kSide * kSide> highest;
    for (int row = 0; row < kSide * kSide; ++row)
      highest[static_cast<std::size_t>(row)] =
          *std::max_element(samples + row * kSide, samples + (row + 1) * kSide);
    const BrickLevel::SampleBits& outside = level_.outside[static_cast<std::size_t>(level_.slot[node])];
    for (int sample = 0; sample < BrickLevel::kSamples; ++sample) {
      // a distance outside is exact: no bound exceeds it
      if (outside[static_cast<std::size_t>(sample)]) continue;
      const Cell at = BrickLevel::cellOfSample(sample);
      int best = samples[sample];
      int best_centre = sample;
      for (int row = 0; row < kSide * kSide; ++row) {
        const int* of_row = decreasesAlong(at, row);
        if (highest[static_cast<std::size_t>(row)] - of_row[kLast] <= best) continue;
        const int* decrease = of_row + (kLast - at.x());
        const std::int16_t* from = samples + row * kSide;
        int best_of_row = best;
        for (int x = 0; x < kSide; ++x) best_of_row = std::max(best_of_row, from[x] - decrease[x]);
        for (int x = 0; best_of_row > best; ++x) {
          if (from[x] - decrease[x] != best_of_row) continue;
          best = best_of_row;
          best_centre = row * kSide + x;
        }
      }
      if (best_centre == sample) continue;
      bounds.push_back(
          {corner + at, corner + BrickLevel::cellOfSample(best_centre), samples[best_centre], best});
    }
  }

  [[nodiscard]] int decreaseInBrick(const Cell& at, const Cell& centre) const {
    return decreasesAlong(at, centre.z() * kSide + centre.y())[kLast - at.x() + centre.x()];
  }

  [[nodiscard]] const int* decreasesAlong(const Cell& at, int row) const {
    const auto z = static_cast<std::size_t>(std::abs(row / kSide - at.z()));
    const auto y = static_cast<std::size_t>(std::abs(row % kSide - at.y()));
    return decreases_[z][y].data();
  }

  void boundFrom(const BrickLevel& coarse, std::size_t node, std::vector<BallBound>& bounds) const {
    const std::int16_t* samples = level_.samplesOf(level_.slot[node]);
    if (*std::min_element(samples, samples + BrickLevel::kSamples) >= 0) return;
    const Cell corner = level_.brickOf(node) * BrickLevel::kVoxels;
    const int divisions = level_.refinement;
    for (int sample = 0; sample < BrickLevel::kSamples; ++sample) {
      if (samples[sample] >= 0) continue;
      const Cell at = corner + BrickLevel::cellOfSample(sample);
      const Cell nearest = (at + Cell::Constant(divisions / 2)) / divisions;
      const std::int16_t* outside = coarse.findSample(nearest);
      if (outside == nullptr || *outside < 0) continue;
      const int radius = *outside * divisions;
      const int value = radius - decreaseOver(at - nearest * divisions);
      if (value > samples[sample]) bounds.push_back({at, nearest * divisions, radius, value});
    }
  }

  BrickLevel& level_;
  ParallelWork& work_;
  std::vector<std::uint8_t> raised_;  // per node
  const DecreaseTable decreases_;
};

}  // namespace

void limitSlope(BrickLevel& level, const BrickLevel* coarse, ParallelWork& work) {
  SlopeLimiter limiter(level, work);
  if (coarse != nullptr) limiter.apply(limiter.boundsFrom(*coarse));
  std::vector<BallBound> bounds = limiter.boundsOfNeighbours();
  while (!bounds.empty() && !work.cancelled()) {
    limiter.apply(std::move(bounds));
    bounds = limiter.boundsWhereRaised();
  }
}

}  // namespace tenon::bake
