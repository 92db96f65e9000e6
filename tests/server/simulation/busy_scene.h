#pragma once

#include <cmath>
#include <limits>

#include "tests/server/collision/baked_pair.h"
#include "tests/server/simulation/small_scene.h"

namespace tenon::test {

/// Twelve objects, five hands and every kind of input within 3,000 ticks, for the determinism tests.
///
///        cube             forearm
///    o       o  pointers                       ------- bar, held edge down
///  [p0][p1][p2][p3]  parts in a row     | wall    <>   beam across it, edge up: their edges cross
///  ===================== floor ==========
struct BusyScene {
  BusyScene() {
    floor = small.object("floor", floorShape(), Vector3::Zero());
    wall = small.object("wall", cornerShape(), {-0.2, -0.2, -0.001});
    const double z = 0.5 * kCubeEdge + 1e-4;
    for (int i = 0; i < 4; ++i) {
      parts[i] = small.object("part" + std::to_string(i), cubeShape(), {-0.1 + 0.06 * i, 0.0, z});
    }
    right_pointer = small.object("right pointer", pointerShape(), {0.0, 0.0, 0.2});
    left_pointer = small.object("left pointer", pointerShape(), {0.1, 0.0, 0.2});
    cube = small.object("cube", cubeShape(), {0.0, 0.2, 0.2});
    forearm = small.object("forearm", pointerShape(), {0.2, 0.2, 0.2});
    right = small.hand("right", right_pointer);
    left = small.hand("left", left_pointer);
    instructor = small.hand("instructor", cube);
    arm = small.hand("forearm", forearm, simulation::HandKind::kTracked);
    beam = small.object("beam", beamShape(), kBeam);
    bar = small.object("bar", heldBarShape(), kBeam + Vector3(0.0, 0.0, 0.05));
    crossing = small.hand("crossing", bar);
    for (const ObjectId moving :
         {right_pointer, left_pointer, cube, parts[0], parts[1], parts[2], parts[3]}) {
      small.pair(moving, floor);
      small.pair(moving, wall);
    }
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < i; ++j) small.pair(parts[i], parts[j]);
      for (const ObjectId pushing : {right_pointer, left_pointer, cube}) small.pair(pushing, parts[i]);
      small.pair(forearm, parts[i], true);
    }
    small.pair(right_pointer, left_pointer);
    small.pair(forearm, floor, true);
    small.pair(bar, beam);
    scene = small.build();
  }

  static StructuresPtr cornerShape() {
    static const StructuresPtr shape = cornerStructures(0.15, 0.005);
    return shape;
  }

  static StructuresPtr heldBarShape() {
    static const StructuresPtr shape = barShape(Vector3::UnitX());
    return shape;
  }
  static StructuresPtr beamShape() {
    static const StructuresPtr shape = barShape(Vector3::UnitY());
    return shape;
  }

  /// All inputs of this tick; a function of the tick only.
  void act(simulation::Environment& environment, Tick tick) const {
    const double t = static_cast<double>(tick) * 1e-3;
    const auto wave = [t](double hertz, double phase) {
      return std::sin(6.283185307179586 * hertz * t + phase);
    };
    const auto pose = [&](double x, double y, double z, double phase) {
      return Pose(Vector3(x + 0.08 * wave(0.7, phase), y + 0.05 * wave(0.9, 2.0 * phase),
                          z + 0.05 * wave(1.3, phase)),
                  expRotation({0.3 * wave(0.5, phase), 0.2 * wave(0.8, phase), 0.4 * wave(0.3, phase)}));
    };
    if (tick == 1) {
      for (const HandId hand : {right, left, instructor, arm, crossing})
        environment.setHandPresent(hand, true);
    }
    environment.setHandPose(right, pose(-0.04, 0.0, 0.05, 0.0), {});
    environment.setHandPose(left, pose(0.04, 0.0, 0.05, 1.0), {});
    environment.setHandPose(instructor, pose(0.0, 0.02, 0.05, 2.0), {});
    environment.setHandPose(arm, pose(0.02, -0.02, 0.04, 3.0), {});
    // presses into the beam and leaves it, slides to its end and beyond
    const Vector3 p_BeamH(0.01 * wave(0.6, 0.0), 0.02 + 0.012 * wave(0.4, 1.0),
                          2.0 * kBarEdge + 0.003 * wave(1.7, 0.0));
    environment.setHandPose(
        crossing, Pose(kBeam + p_BeamH, expRotation({0.05 * wave(0.5, 1.0), 0.0, 0.2 * wave(0.3, 0.0)})), {});
    const double nan = std::numeric_limits<double>::quiet_NaN();
    switch (tick) {
      case 300:
        environment.grab(right, parts[0]);
        break;
      case 500:
        environment.grab(left, parts[2]);
        break;
      case 700:
        environment.setHandPose(right, Pose(Vector3(nan, 0.0, 0.0)), {});
        break;
      case 900:
        environment.grab(left, parts[0]);
        break;
      case 1200:
        environment.release(right);
        break;
      case 1300:
        environment.place(parts[1], Pose(Vector3(0.1, 0.1, 0.05)), ObjectStatus::kFixed);
        break;
      case 1500:
        environment.setHandFrozen(left, true);
        break;
      case 1550:
        environment.setHandFrozen(left, false);
        break;
      case 1700:
        environment.setHandPresent(instructor, false);
        break;
      case 1800:
        environment.setHandPresent(instructor, true);
        break;
      case 2000:
        environment.setPairEnabled(0, false);
        break;
      case 2100:
        environment.setPairEnabled(0, true);
        break;
      case 2200:
        environment.swapHands(right, left);
        break;
      case 2400:
        environment.place(parts[3], Pose(), ObjectStatus::kHidden);
        break;
      case 2600:
        environment.grab(right, parts[3]);
        break;
      default:
        break;
    }
    if (tick % 50 == 0) environment.contribute(parts[0], 5, {Vector3(3.0, 0.0, 1.0), Vector3::Zero()}, 80);
  }

  void play(simulation::Environment& environment, Tick until) const {
    while (environment.tick() < until) {
      act(environment, environment.tick() + 1);
      environment.step();
    }
  }

  inline static const Vector3 kBeam{0.25, -0.25, 0.15};  ///< [m] p_WO of the beam

  SmallScene small;
  std::shared_ptr<const simulation::Scene> scene;
  ObjectId floor, wall, right_pointer, left_pointer, cube, forearm, bar, beam;
  ObjectId parts[4];
  HandId right, left, instructor, arm, crossing;
};

}  // namespace tenon::test
