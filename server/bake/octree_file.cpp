#include "server/bake/octree_file.h"

#include <array>
#include <fstream>
#include <memory>
#include <string>

#define OCTOMAP_NODEBUGOUT  // its templates print on stderr otherwise
#include <octomap/OcTree.h>
#include <unistd.h>

#include "idl/types/output_files.h"
#include "server/bake/voxel_set.h"

namespace tenon::bake {

namespace {

constexpr unsigned kDepth = 16;  // of every OctoMap
constexpr std::size_t kMaxCorners = 180'000'000;
constexpr int kKeys = 1 << kDepth;

/// The number of nodes according to the header: OctoMap itself does not report a truncated file.
Result<std::size_t> statedNodes(std::istream& in) {
  std::string line;
  if (!std::getline(in, line) || line.rfind("# Octomap OcTree", 0) != 0)
    return fail("is not an OctoMap file");
  while (std::getline(in, line) && line != "data") {
    if (line.rfind("size ", 0) == 0)
      return static_cast<std::size_t>(std::strtoull(line.c_str() + 5, nullptr, 10));
  }
  return fail("has no `size` line in its header");
}

/// Collects the faces between occupied and other cells.
class OctreeSurface {
 public:
  explicit OctreeSurface(const octomap::OcTree& tree) : tree_(tree) {}

  Result<std::vector<Vector3f>> all() {
    for (auto leaf = tree_.begin_leafs(); leaf != tree_.end_leafs(); ++leaf) {
      if (!tree_.isNodeOccupied(*leaf)) continue;
      const octomap::OcTreeKey key = leaf.getIndexKey();
      const Eigen::Vector3i low(key[0], key[1], key[2]);
      const int size = 1 << (kDepth - leaf.getDepth());
      for (int face = 0; face < 6; ++face) addFace(low, size, face);
      if (corners_.size() > kMaxCorners) return fail("its surface has more than 60 million triangles");
    }
    if (corners_.empty()) return fail("has no occupied cell");
    return std::move(corners_);
  }

 private:
  /// Adds a face of a cube of keys where the cell behind it is not occupied; subdivides it where the cells
  /// behind are smaller.
  void addFace(const Eigen::Vector3i& low, int size, int face) {
    const int axis = face / 2;
    Eigen::Vector3i behind = low;
    behind[axis] += face % 2 == 0 ? -size : size;
    if (behind[axis] < 0 || behind[axis] >= kKeys) return addQuad(low, size, face);
    const octomap::OcTreeKey key(static_cast<octomap::key_type>(behind.x()),
                                 static_cast<octomap::key_type>(behind.y()),
                                 static_cast<octomap::key_type>(behind.z()));
    unsigned depth = kDepth;
    for (int s = size; s > 1; s /= 2) --depth;
    const octomap::OcTreeNode* node = tree_.search(key, depth);
    if (node == nullptr) return addQuad(low, size, face);
    if (!tree_.nodeHasChildren(node) || size == 1) {
      if (!tree_.isNodeOccupied(node)) addQuad(low, size, face);
      return;
    }
    const int half = size / 2;
    for (int part = 0; part < 4; ++part) {
      Eigen::Vector3i from = low;
      from[(axis + 1) % 3] += part % 2 == 0 ? 0 : half;
      from[(axis + 2) % 3] += part / 2 == 0 ? 0 : half;
      if (face % 2 == 1) from[axis] += half;
      addFace(from, half, face);
    }
  }

  void addQuad(const Eigen::Vector3i& low, int size, int face) {
    const int axis = face / 2;
    std::array<Vector3f, 4> corner;
    for (std::size_t i = 0; i < 4; ++i) {
      Eigen::Vector3i at = low;
      if (face % 2 == 1) at[axis] += size;
      if (i == 1 || i == 2) at[(axis + 1) % 3] += size;
      if (i >= 2) at[(axis + 2) % 3] += size;
      const Vector3 p = (at.cast<double>().array() - kKeys / 2).matrix() * tree_.getResolution();
      corner[i] = p.cast<float>();
    }
    corners_.insert(corners_.end(), {corner[0], corner[1], corner[2], corner[0], corner[2], corner[3]});
  }

  const octomap::OcTree& tree_;
  std::vector<Vector3f> corners_;
};

}  // namespace

bool isOctree(const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  return extension == ".bt" || extension == ".ot";
}

Result<std::vector<Vector3f>> readOctreeSurface(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  const auto stated = statedNodes(in);
  if (!stated) return tl::unexpected(stated.error());
  in.clear();
  in.seekg(0);
  std::unique_ptr<octomap::OcTree> tree;
  if (file.extension() == ".bt") {
    tree = std::make_unique<octomap::OcTree>(0.1);
    if (!tree->readBinary(in)) tree.reset();
  } else {
    std::unique_ptr<octomap::AbstractOcTree> read(octomap::AbstractOcTree::read(in));
    if (auto* octree = dynamic_cast<octomap::OcTree*>(read.get()); octree != nullptr) {
      tree.reset(octree);
      (void)read.release();
    }
  }
  if (!tree) return fail("cannot be read as an OctoMap of kind OcTree");
  if (in.fail() || tree->calcNumNodes() != *stated)
    return fail("is truncated: its header states another number of nodes");
  if (!(tree->getResolution() > 0.0) || !std::isfinite(tree->getResolution()))
    return fail("has no valid resolution");
  return OctreeSurface(*tree).all();
}

Result<void> writeOctree(const std::filesystem::path& file, const VoxelSet& cells) {
  if (!isOctree(file)) return fail(file.string() + ": must end in .bt or .ot");
  octomap::OcTree tree(cells.cell());
  constexpr int kHalf = kKeys / 2;
  bool fits = true;
  cells.visit([&](const Eigen::Vector3i& cell) {
    const Eigen::Array3i key = cell.array() + kHalf;
    fits = fits && (key >= 0).all() && (key < kKeys).all();
    if (!fits) return;
    const octomap::OcTreeKey octree_key(static_cast<octomap::key_type>(key.x()),
                                        static_cast<octomap::key_type>(key.y()),
                                        static_cast<octomap::key_type>(key.z()));
    tree.setNodeValue(octree_key, tree.getClampingThresMaxLog(), true);
  });
  if (!fits)
    return fail(file.string() +
                ": an octree has at most 32768 cells on each side of the origin; choose larger ones");
  tree.updateInnerOccupancy();
  tree.prune();
  const bool in_place = isWrittenInPlace(file);
  const std::filesystem::path part =
      in_place ? file : std::filesystem::path(file.string() + ".part" + std::to_string(::getpid()));
  std::ofstream out(part, std::ios::binary | std::ios::trunc);
  // not OctoMap's write(), which prints on stderr
  const bool binary = file.extension() == ".bt";
  out << "# Octomap OcTree " << (binary ? "binary file" : "file") << "\n"
      << "# (feel free to add / change comments, but leave the first line as it is!)\n#\n"
      << "id " << tree.getTreeType() << "\nsize " << tree.size() << "\nres " << tree.getResolution()
      << "\ndata\n";
  if (binary) {
    tree.writeBinaryData(out);
  } else {
    tree.writeData(out);
  }
  out.close();
  std::error_code error;
  if (out && !in_place) std::filesystem::rename(part, file, error);
  if (!out || error) {
    std::error_code ignored;
    if (!in_place) std::filesystem::remove(part, ignored);
    return fail(file.string() + ": cannot be written" + (error ? ": " + error.message() : std::string{}));
  }
  return {};
}

}  // namespace tenon::bake
