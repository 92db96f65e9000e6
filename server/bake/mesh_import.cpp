#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <thread>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/bake/bake.h"
#include "server/bake/import_pipe.h"
#include "server/bake/mesh_file_checks.h"
#include "server/bake/mesh_references.h"
#include "server/bake/octree_file.h"

extern char** environ;

namespace tenon::bake {

namespace {

constexpr double kMaxCoordinate = 1e5;  // [m]
constexpr double kMinSize = 1e-6;       // [m] of the whole mesh
// A mesh with a larger fraction of invalid triangles is refused.
constexpr double kMaxInvalid = 0.1;

/// A file descriptor, closed by the destructor.
class Descriptor {
 public:
  explicit Descriptor(int value) : value_(value) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  [[nodiscard]] int get() const { return value_; }

 private:
  int value_;
};

/// The importing program: named by the environment variable TENON_BAKE, or tenon-bake in the folder of the
/// running program.
std::filesystem::path importerProgram() {
  if (const char* named = std::getenv("TENON_BAKE"); named != nullptr && *named != '\0') return named;
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / "tenon-bake";
}

ImportLimits limitsFor(const std::filesystem::path& file, std::uint64_t file_bytes) {
  const double megabytes = static_cast<double>(file_bytes) / 1e6;
  // an octree file stores eight leaves in two bytes
  const std::uint64_t growth = isOctree(file) ? 512 : 64;
  return {10.0 + std::ceil(megabytes), (768ULL << 20U) + growth * file_bytes};
}

constexpr int kTooSlow = -1;
constexpr int kCancelled = -2;

/// Waits for the child and kills it after `seconds` [s], or when `progress` cancels. Returns its wait status,
/// or why it was killed.
int waitFor(pid_t child, double seconds, const BakeProgress& progress) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  constexpr std::chrono::milliseconds kBetweenReports{100};
  auto report_at = std::chrono::steady_clock::now() + kBetweenReports;
  int status = 0;
  while (true) {
    const pid_t done = ::waitpid(child, &status, WNOHANG);
    if (done == child) return status;
    if (done < 0 && errno != EINTR) return kTooSlow;
    const auto now = std::chrono::steady_clock::now();
    bool is_cancelled = false;
    if (progress && now > report_at) {
      is_cancelled = !progress(0.0, kReadingMeshes);
      report_at = now + kBetweenReports;
    }
    if (is_cancelled || now > end) {
      ::kill(child, SIGKILL);
      while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
      }
      return is_cancelled ? kCancelled : kTooSlow;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

Result<pid_t> startImporter(const std::filesystem::path& file, double unit, const ImportLimits& limits,
                            int memory) {
  const std::string program = importerProgram().string();
  char number[40];
  std::snprintf(number, sizeof number, "%.17g", unit);
  std::vector<std::string> words{program,
                                 kImportChildFlag,
                                 std::filesystem::absolute(file).string(),
                                 number,
                                 std::to_string(static_cast<long>(std::ceil(limits.cpu_seconds))),
                                 std::to_string(limits.memory_bytes)};
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, memory, kImportDescriptor);
  pid_t child = -1;
  const int problem = ::posix_spawn(&child, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (problem != 0) return fail("the importer " + program + " cannot be started: " + std::strerror(problem));
  return child;
}

std::string readText(int memory, std::uint64_t offset, std::uint64_t bytes) {
  std::string text(std::min<std::uint64_t>(bytes, 400), '\0');
  const ssize_t got = ::pread(memory, text.data(), text.size(), static_cast<off_t>(offset));
  text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  // control characters, so that the message is one line
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 32; }, ' ');
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

bool readArray(int memory, std::uint64_t offset, void* to, std::uint64_t bytes) {
  auto* next = static_cast<char*>(to);
  while (bytes > 0) {
    const ssize_t got = ::pread(memory, next, bytes, static_cast<off_t>(offset));
    if (got <= 0) return false;
    next += got;
    offset += static_cast<std::uint64_t>(got);
    bytes -= static_cast<std::uint64_t>(got);
  }
  return true;
}

/// The child's result; an error unless its sizes are consistent and every index is in range.
Result<TriangleMesh> readImported(const std::string& name, int memory) {
  struct stat status {};
  ImportHeader header;
  if (::fstat(memory, &status) != 0 || !readArray(memory, 0, &header, sizeof header) ||
      header.magic != ImportHeader::kMagic) {
    return fail(name + ": the importer returned no result");
  }
  const auto size = static_cast<std::uint64_t>(status.st_size);
  constexpr std::uint64_t kMost = 1ULL << 32U;
  if (header.vertices >= kMost || header.triangles >= kMost || header.text_bytes >= kMost ||
      (header.colors != 0 && header.colors != header.triangles) ||
      sizeof header + 12 * header.vertices + 12 * header.triangles + 4 * header.colors + header.text_bytes !=
          size) {
    return fail(name + ": the importer returned an inconsistent result");
  }
  const std::uint64_t text_at = size - header.text_bytes;
  if (header.failed != 0) return fail(name + ": " + readText(memory, text_at, header.text_bytes));
  TriangleMesh mesh;
  mesh.vertices.resize(header.vertices);
  mesh.triangles.resize(header.triangles);
  mesh.colors.resize(header.colors);
  if (!readArray(memory, sizeof header, mesh.vertices.data(), 12 * header.vertices) ||
      !readArray(memory, sizeof header + 12 * header.vertices, mesh.triangles.data(),
                 12 * header.triangles) ||
      !readArray(memory, sizeof header + 12 * header.vertices + 12 * header.triangles, mesh.colors.data(),
                 4 * header.colors)) {
    return fail(name + ": the importer's result cannot be read");
  }
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) {
      if (corner >= mesh.vertices.size()) return fail(name + ": a triangle has a vertex index out of range");
    }
  }
  return mesh;
}

double signedVolume(const TriangleMesh& mesh) {
  double volume = 0.0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vector3 p = mesh.vertices[a].cast<double>();
    volume += p.dot(mesh.vertices[b].cast<double>().cross(mesh.vertices[c].cast<double>())) / 6;
  }
  return volume;
}

/// Skips triangles that are not finite; an error when too few remain or the size is not plausible.
Result<TriangleMesh> checked(const std::string& name, TriangleMesh mesh) {
  const std::size_t before = mesh.triangles.size();
  if (before == 0) return fail(name + ": has no triangles");
  std::size_t valid = 0;
  for (std::size_t i = 0; i < before; ++i) {
    const auto& triangle = mesh.triangles[i];
    if (!std::all_of(triangle.begin(), triangle.end(),
                     [&](std::uint32_t corner) { return mesh.vertices[corner].allFinite(); }))
      continue;
    mesh.triangles[valid] = triangle;
    if (!mesh.colors.empty()) mesh.colors[valid] = mesh.colors[i];
    ++valid;
  }
  mesh.triangles.resize(valid);
  if (!mesh.colors.empty()) mesh.colors.resize(valid);
  const std::size_t invalid = before - valid;
  if (static_cast<double>(invalid) > kMaxInvalid * static_cast<double>(before)) {
    return fail(name + ": " + std::to_string(invalid) + " of " + std::to_string(before) +
                " triangles have vertices that are not finite");
  }
  if (invalid > 0) {
    mesh.notes.push_back(name + ": " + std::to_string(invalid) +
                         " triangles have vertices that are not finite and were skipped.");
  }
  // unused vertices may still not be finite
  for (Vector3f& p : mesh.vertices) {
    if (!p.allFinite()) p.setZero();
  }
  Eigen::AlignedBox3d box;
  bool any_area = false;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vector3 pa = mesh.vertices[a].cast<double>();
    const Vector3 pb = mesh.vertices[b].cast<double>();
    const Vector3 pc = mesh.vertices[c].cast<double>();
    box.extend(pa).extend(pb).extend(pc);
    any_area = any_area || (pb - pa).cross(pc - pa).norm() > 0.0;
  }
  if (box.min().cwiseAbs().maxCoeff() > kMaxCoordinate || box.max().cwiseAbs().maxCoeff() > kMaxCoordinate) {
    return fail(name + ": has coordinates of more than 100 km; is the unit right?");
  }
  if (box.diagonal().norm() < kMinSize)
    return fail(name + ": is smaller than a micrometre; is the unit right?");
  if (!any_area) return fail(name + ": no triangle has an area");
  if (signedVolume(mesh) < 0.0) {
    mesh.notes.push_back(name +
                         ": its normals point inwards; this has no effect, since winding is not used.");
  }
  return mesh;
}

}  // namespace

Result<TriangleMesh> importMesh(const std::filesystem::path& file, double unit,
                                const BakeProgress& progress) {
  const std::string name = file.string();
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return fail(name + ": no such file");
  auto bytes = std::filesystem::file_size(file, error);
  if (error || bytes == 0) return fail(name + ": is empty");
  for (const MeshReference& reference : referencesOf(file)) {
    const auto more = reference.file.empty() ? 0 : std::filesystem::file_size(reference.file, error);
    if (!error) bytes += more;
  }
  if (!(unit > 0.0) || !std::isfinite(unit)) return fail(name + ": the unit must be a length greater than 0");
  if (const auto problem = problemInMeshFile(file)) return fail(name + ": " + *problem);

  // a descriptor above 3, so that dup2 onto 3 makes a copy without close-on-exec
  const Descriptor low(::memfd_create("tenon-import", MFD_CLOEXEC));
  const Descriptor memory(::fcntl(low.get(), F_DUPFD_CLOEXEC, 16));
  if (memory.get() < 0) return fail(name + ": cannot create a memory file for the importer");
  const ImportLimits limits = limitsFor(file, bytes);
  const auto child = startImporter(file, unit, limits, memory.get());
  if (!child) return fail(name + ": " + child.error().what);
  // the child limits its own processor time; other processes may delay it
  const int status = waitFor(*child, 4.0 * limits.cpu_seconds, progress);
  if (status == kCancelled) return fail("cancelled");
  if (status == kTooSlow || (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) ||
      (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU)) {
    return fail(name + ": reading it took too long; the file is probably damaged");
  }
  // Ctrl-C reaches all processes of a terminal
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGINT || WTERMSIG(status) == SIGTERM))
    return fail(name + ": its import was interrupted");
  if (WIFSIGNALED(status)) {
    return fail(name + ": the importer crashed on it (" + strsignal(WTERMSIG(status)) +
                "); the file is damaged");
  }
  if (WEXITSTATUS(status) != 0) {
    return fail(name + ": the importer failed (exit code " + std::to_string(WEXITSTATUS(status)) + ")");
  }
  auto mesh = readImported(name, memory.get());
  if (!mesh) return mesh;
  return checked(name, std::move(*mesh));
}

}  // namespace tenon::bake
