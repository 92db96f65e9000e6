#pragma once

#include <string>
#include <utility>

namespace tenon::test {

/// A scenario of a box with a socket, a part that fits into it, a pointer and an instructor's cube; tests
/// replace pieces of it. Its first line is line 1 in errors.
inline std::string smallScenario() {
  return R"(title: Small
objects:
  - {name: bay, kind: scene, meshes: [{part: bay}], status: fixed, structures: {voxel: 1 mm, refinement: 4}}
  - {name: part, meshes: [{part: part}], status: hidden, start: {at: [0.2, 0, 0.1]}, structures: {voxel: 2 mm}}
  - {name: pointer, kind: pointer, meshes: [{part: pointer}], structures: {voxel: 2 mm}}
  - {name: cube, kind: assistant, meshes: [{part: cube}], structures: {voxel: 2 mm}, start: {at: [-0.3, 0, 0.2]}}
hands:
  - {name: right, object: pointer}
  - {name: instructor, role: instructor, object: cube}
pairs:
  - {between: [part, bay], clearance: 4 mm}
states:
  - name: take
    touch: part
    for: 0.1 s
  - name: mount
    hands: {right: part}
    object: part
    target: {at: [0, 0, -20 mm], within: 2 mm, angle: 2 deg, dwell: 50 ms}
    approach: {direction: [0, 0, -1], distance: 50 mm}
    snap: true
    timeout: 2 s
)";
}

/// The text with the first occurrence of `from` replaced; unchanged when there is none.
inline std::string with(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  if (at != std::string::npos) text.replace(at, from.size(), to);
  return text;
}

}  // namespace tenon::test
