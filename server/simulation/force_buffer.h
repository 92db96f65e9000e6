#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/spatial.h"

namespace tenon {

/// When a new cell makes a new total worth sending (paper §3.2, iv).
enum class SendPolicy : std::uint8_t {
  kEveryForce,  ///< whenever a force arrives
  kOldestCell,  ///< when the cell that had waited longest is refreshed: about once for all sources
};

/// What one source exerts.
struct ForceCell {
  Wrench F_Bo_W;
  Tick stamp = 0;                    ///< of the last write
  std::uint32_t source = 0;          ///< of a contribution: its sender's name for it
  std::uint32_t lifetime_ticks = 0;  ///< 0: stays until overwritten
  bool used = false;
};

/// Sums what several sources exert on one object (paper §3.2, iii-iv).
///
/// Every source owns one cell and overwrites it: first the own cells (pairs, couplings of hands), which stay
/// until overwritten, so a pair skipped by coherence leaves its cell as it was; then cells for contributions
/// from outside, which are checked, capped, fade linearly with age and expire. Cells are summed in cell
/// order, never in arrival order: the total is the same to the last bit for any number of workers. Which own
/// cells are in use is listed in order, so that a sum costs what pushes, not what could.
///
/// Threads: one writer per own cell, contributions from one thread; total() after the tick's barrier.
/// Real-time: everything but the constructor.
class ForceBuffer {
 public:
  static constexpr std::size_t kContributions = 8;
  /// A hand-held device displays at most this, so nobody outside may ask for more.
  static constexpr double kMaxContributedForce = 50.0;
  static constexpr double kMaxContributedTorque = 5.0;
  /// A source that has been silent for longer is not pushing any more.
  static constexpr std::uint32_t kMaxLifetimeTicks = 200;

  explicit ForceBuffer(std::size_t own_cells, SendPolicy policy = SendPolicy::kEveryForce);

  /// Overwrites an own cell. True when a total is due.
  bool write(std::size_t cell, const Wrench& F_Bo_W, Tick now) noexcept;
  void clear(std::size_t cell) noexcept;

  /// Overwrites the cell of `source` or takes a free one. False, and counted in refused(), when the wrench is
  /// not finite, its lifetime is zero or no cell is free; longer lifetimes and larger wrenches are cut.
  bool contribute(std::uint32_t source, const Wrench& F_Bo_W, std::uint32_t lifetime_ticks,
                  Tick now) noexcept;
  /// Frees the contributions that have outlived their lifetime.
  void expire(Tick now) noexcept;

  /// Of all cells, in cell order, at their weight of `now`.
  [[nodiscard]] Wrench total(Tick now) const noexcept;
  /// Of the contributions alone.
  [[nodiscard]] Wrench contributed(Tick now) const noexcept;
  [[nodiscard]] Wrench cell(std::size_t index) const noexcept { return cells_[index].F_Bo_W; }
  /// Ticks since the cell was written.
  [[nodiscard]] Tick age(std::size_t index, Tick now) const noexcept { return now - cells_[index].stamp; }
  [[nodiscard]] std::uint64_t refused() const noexcept { return refused_; }

  [[nodiscard]] std::span<const ForceCell> cells() const noexcept { return cells_; }

  /// The cells in use, to be written, read or hashed.
  template <typename Archive, typename Self>
  static void archive(Archive& archive, Self& self) {
    auto own = static_cast<std::uint32_t>(self.used_.size());
    archive(own);
    if constexpr (Archive::kReads) {
      for (const std::uint32_t cell : self.used_) self.cells_[cell] = ForceCell{};
      self.used_.clear();
    }
    for (std::uint32_t i = 0; i < own; ++i) {
      std::uint32_t cell = Archive::kReads ? 0 : self.used_[i];
      archive(cell);
      if constexpr (Archive::kReads) {
        const bool next = cell < self.own_cells_ && (i == 0 || cell > self.used_.back());
        if (!archive.ok() || !next) return archive.refuse();
        self.used_.push_back(cell);
      }
      archive(self.cells_[cell]);
      if constexpr (Archive::kReads) {
        if (!self.cells_[cell].used) return archive.refuse();
      }
    }
    archive(self.contributing_);
    if constexpr (Archive::kReads) {
      for (ForceCell& cell : std::span(self.cells_).subspan(self.own_cells_)) cell = ForceCell{};
    }
    for (std::size_t i = 0; i < kContributions; ++i) {
      if ((self.contributing_ >> i & 1U) != 0) archive(self.cells_[self.own_cells_ + i]);
    }
  }

 private:
  [[nodiscard]] bool oldest(std::size_t cell) const noexcept;
  [[nodiscard]] bool due(std::size_t cell) const noexcept;

  std::vector<ForceCell> cells_;
  std::vector<std::uint32_t> used_;  // own cells, in order
  std::uint8_t contributing_ = 0;    // one bit a contribution in use: most objects have none
  std::size_t own_cells_;
  SendPolicy policy_;
  std::uint64_t refused_ = 0;
};

}  // namespace tenon
