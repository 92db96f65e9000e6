#!/usr/bin/env python3
"""Shows that the tests of docs/safety.md hold its rules: takes each rule out of the sources, builds, and expects the tests of its row to fail.

    python3 tests/safety_mutations.py [--list] [HAZARD ...]

HAZARD is a part of a row's first column. It edits the sources of the tree that it stands in, one rule at a time, and puts them back; the
build folder is that of the preset dev. Not in the gate: an hour of building. Rows whose tests are scripts of tests/system are listed only.
Exit code 1: a rule can be taken out unnoticed, or is not where this file looks for it.
"""
import argparse
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HAND, SAFETY, MODEL = "clients/haptic/haptic_hand.cpp", "devices/safety.cpp", "clients/haptic/local_model.cpp"
AGE, BRACELET, WORKSPACE = "clients/haptic/answer_age.cpp", "clients/haptic/bracelet.cpp", "clients/haptic/workspace.cpp"
REMOTE, REGISTRY, WRITER = "devices/drivers/remote_device.cpp", "server/session/session_registry.cpp", "server/session/journal_writer.cpp"
ARMING = "clients/haptic/arming.h"

# hazard (begin of its row), edits (file, pattern, replacement), program, tests
RULES = [
    ("a trainee's hand obeys another", [("idl/wire/membership.cpp", r"member->session_->hearOnly\(member->server_\);", ""),
                                        ("idl/wire/membership.cpp", r"next\.server_epoch >= announce\.server_epoch", "next.server_epoch <= announce.server_epoch")],
     "idl_wire_tests", "Membership.BelongsToTheServerOfItsNameThatStartedFirst"),
    ("somebody takes a person's hands", [(REGISTRY, r"  if \(former && !proofs\.seat\)\n\s*return [^;]*;\n", "")],
     "server_session_tests", "SessionRegistryTest.*:SessionServer.AClientThatKnowsThePublicKeyOfASeatAloneEvictsNobody"),
    ("a late or doubled message lifts", [("idl/types/stop_truth.cpp", r"cleared_\.contains\(id\) \|\| ", "")], "idl_types_tests", "StopTruth.*"),
    ("a device is armed from afar", [(ARMING, r"return armed_ && !stopped_;", "return !stopped_;")], "clients_haptic_tests", "Arming.NothingButThePersonArms"),
    ("a killed server is resumed and moves", [("server/simulation/environment_hands.cpp", r"kGraspReach = 5e-3", "kGraspReach = 5e3")],
     "server_session_tests", "ReturningHand.HoldsItsObjectAgainWhereItHeldIt"),
    ("a recorder that hangs, or a full disk", [(WRITER, r"writePending\(false\)", "writePending(true)"), (WRITER, r"const bool writes = journal_ && !problem\(\);", "const bool writes = journal_ && !problem();\n  if (problem()) return;")],
     "server_session_tests", "JournalWriterTest.AReaderThatHangsLeavesNoGapInTheFile:JournalWriterTest.AFullDiskEndsTheFileAndNotTheCopies"),
    ("a client fills the queue", [("server/session/contributions.h", r"waiting\.size\(\) < kMostOfClient", "true"), ("server/session/contributions.h", r" \|\| to\.freeChanges\(\) < InputBuffer::kChanges / 2", "")],
     "server_session_tests", "Contributions.LeaveHalfOfTheQueueToCommands"),
    ("motion starts when a stop is cleared", [(REGISTRY, r"  changes_\.push_back\(\{\.kind = ChangeKind::kPause\}\);\n", "")],
     "server_session_tests", "SessionRegistryTest.AClearedEmergencyStopLeavesTheRunPaused"),
    ("after a gap the hand is thrown", [(HAND, r"workspace_\.shift\(([^;]*)\);", r"workspace_.shift(0.0 * (\1));")], "clients_haptic_tests",
     "ForceReturnOffset.IsSentAndDecaysOutOfContactAlone:*AFreezeIsSoft*:*AfterAGapIsSoft*"),
    ("a force is back at once", [(SAFETY, r"starting_ \? std::max\(0\.0, limits_\.start_force_slew \* growth - wall_growth\)", "starting_ ? limits_.force_slew * growth - 0.0 * wall_growth")],
     "clients_haptic_tests", "*ForceReturn.AfterAGapIsSoft*"),
    ("a force comes back larger", [(SAFETY, r"  if \(start < 1\.0\) ramped\.force = [^;]*;\n", ""), (SAFETY, r"double start = ", "double start = ")], "devices_tests",
     "Safety.AForceThatStartsFromNothingIsAtMostThreeNewtonForASecond"),
    ("an object that was held still", [(MODEL, r"!manifold_\.frozen && ", "")], "clients_haptic_tests", "*AFreezeIsSoft*"),
    ("the held object jumps", [(MODEL, r"!same \|\| anyBody", "anyBody")], "clients_haptic_tests", "*AJumpOfTheHeldObjectIsSoft*"),
    ("a body that it touches jumps", [(MODEL, r"!same \|\| anyBodyJumped\(manifold_, manifold\)", "!same || (anyBodyJumped(manifold_, manifold) && same && !same)")],
     "clients_haptic_tests", "*AJumpOfTheBodyItTouchesIsSoft*"),
    ("a force begins while a person is not ready", [(SAFETY, r"(  \} else \{\n)    startFromZero\(\);\n", r"\1"), (SAFETY, r"(  braking_ = false;\n)  startFromZero\(\);\n", r"\1"),
                                                    (HAND, r"permitted_ && safety_\.forcesOn\(\) &&", "")], "clients_haptic_tests", "*AStopIsSoftOnceThePersonHasPressed*"),
    ("the offset moves what a part touches", [(HAND, r"X_DH\.translation\(\), hold, dt", "X_DH.translation(), false && hold, dt")], "clients_haptic_tests", "ForceReturnOffset.StaysInContact"),
    ("a coupling is stiffer", [(REGISTRY, r"return \{least\(offered\.translational[^;]*;", "static_cast<void>(least);\n  return offered;")], "server_session_tests",
     "SessionRegistryTest.ACouplingIsAsStiffAsItsDeviceAllowsUnlessTheScenarioWantsLess"),
    ("a coupling is stiffer", [(SAFETY, r"const double stiffness_factor = [^;]*;", "const double stiffness_factor = 1.0;")], "devices_tests",
     "Safety.ScalesAForceToThePassiveStiffnessOfTheDevice"),
    ("contacts arrive and are old", [(AGE, r"  if \(answered == answered_\) return;\n", ""), (AGE, r"read\.seq == answered \? read\.at : -kNever", "read.seq == answered ? now_ : now_")],
     "clients_haptic_tests", "HandSafety.TheAgeOfContactsIsThatOfTheInput*"),
    ("the station itself stood still", [(AGE, r"now_ \+= dt;", "now_ += 1e-3 + 0.0 * dt;")], "clients_haptic_tests", "HandSafety.TheAgeOfContactsCountsTheTimeThatACycleTook"),
    ("the station itself stood still", [(SAFETY, r"const double growth = std::min\(dt, kLongestGrowth\);\n  since", "const double growth = dt;\n  since")], "devices_tests",
     "Safety.ALongStepLetsAForceGrowAsTwoMilliseconds"),
    ("the person has let go", [(HAND, r"  request\.dead_man_held = deadManHeld\(\);\n", "")], "clients_haptic_tests", "HandSafety.AReleasedDeadManSwitch*"),
    ("a stopped arm falls", [(HAND, r"  device_\.write\(command\);([^\n]*)\n  if \(safety_\.wantsDisarm\(\)\) device_\.disarm\(\);", r"  if (safety_.wantsDisarm()) return device_.disarm();\n  device_.write(command);")],
     "clients_haptic_tests", "HandSafety.A*Brakes*:HandSafety.An*Brakes*"),
    ("armed at the end of the workspace", [(SAFETY, r"  wall_ = slewLimited\([^;]*;", "  wall_ = wallForce(state.X_DH.translation(), limits_) + 0.0 * wall * (slow ? 1.0 : growth);")],
     "clients_haptic_tests", "HandSafety.TheEndOfTheWorkspaceRampsAfterArming"),
    ("the bracelet vibrates on", [(SAFETY, r"request\.restart \? 0\.0 : ageFactor\(request\.age, limits_\)", "request.restart ? 0.0 : 1.0")], "clients_haptic_tests", "Bracelet.*"),
    ("the bracelet vibrates on", [(BRACELET, r"  request\.emergency_stop = !permitted_;\n", "")], "clients_haptic_tests", "Bracelet.*"),
    ("a hand falls to the end of its workspace", [(SAFETY, r"  if \(starting_\) wall = clampNorm\([^;]*;\n", ""), (SAFETY, r"starting_ \|\| late_ \|\| wall_since_", "wall_since_")], "devices_tests",
     "Safety.AHandThatFallsToTheEndOfItsWorkspaceInAGapIsMetSoftly"),
    ("forces come on while contacts are late", [(SAFETY, r" \|\| \(late_ && !late\) \|\| \(late && starting_\)", "")], "devices_tests",
     "Safety.ForcesThatComeOnWhileContactsAreLateWaitUntilTheyAreFresh"),
    ("a loop that stood still shifts", [(WORKSPACE, r"  dt = std::min\(dt, kLongestStep\);\n", "  static_cast<void>(kLongestStep);\n")], "clients_haptic_tests", "Workspace.ALongStepCountsAsTenMilliseconds"),
    ("old answers after a gap", [(AGE, r"(now_ - window_began_ > kWindow) &&\s*delays_\[0\] < kNever", r"\1")], "clients_haptic_tests", "AnswerAge.AfterALongGapOldAnswersAreNotFresh"),
    ("a stop comes while a device is being armed", [(HAND, r"  if \(!permitted\) handover_\.withdraw\(\);\n", "")], "clients_haptic_tests", "HandSafety.AStopBetweenPressAndArmingLeavesTheDeviceUnarmed"),
    ("an opened clutch is closed", [(HAND, r"  device_state_\.fault = devices::DeviceFault::kNone;\n  device_state_\.F_Ho_D_measured = \{\};\n", "")], "clients_station_tests",
     "DeviceStation.ASimulatedPersonResetsAnOpenClutchAfterTwoSeconds"),
    ("a program that moves a hand (`remote`) hangs", [(REMOTE, r"  if \(silence_ >= kSilent\) target_\.buttons = 0;\n", "")], "devices_tests",
     "RemoteDeviceTest.ASilentPeerHasReleasedTheDeadMansSwitchAndMakesRoomLater"),
    ("it throws the hand across", [(REMOTE, r"clampNorm\(share \* off\.translation, [^)]*\)", "share * off.translation")], "devices_tests", "RemoteDeviceTest.FollowsItsPeerAtABoundedSpeedAndShowsIt"),
    ("it sends nonsense", [(REMOTE, r"if \(!target\) return dropPeer\(\);", "if (!target) continue;")], "devices_tests", "RemoteDeviceTest.AMessageThatCannotBeUnderstoodEndsTheConnection"),
    ("a fault resets itself", [(HAND, r"  handover_\.ask\(\);", "  handover_.ask();\n  static_cast<void>(handover_.serve(device_));")], "clients_haptic_tests", "HandSafety.TheLoopNeitherArmsNorResetsADevice"),
    ("arming blocks the loop", [(HAND, r"  handover_\.ask\(\);", "  handover_.ask();\n  static_cast<void>(handover_.serve(device_));\n  handover_.handBack();")], "clients_haptic_tests",
     "HandSafety.TheLoopNeitherArmsNorResetsADevice"),
]


def hazards() -> list[tuple[str, str]]:
    """Hazard and tests of each row of the tables."""
    rows = re.findall(r"(?m)^\| (.+?) \| .+? \| .+? \| (.+?) \|$", (ROOT / "docs/safety.md").read_text(encoding="utf-8"))
    return [(hazard, tests) for hazard, tests in rows if "`" in tests and hazard != "hazard"]


def judge(edits: list[tuple[str, str, str]], program: str, tests: str) -> str:
    """What became of the tests without the rule."""
    kept = {file: (ROOT / file).read_text(encoding="utf-8") for file, _, _ in edits}
    try:
        for file, pattern, replacement in edits:
            text, count = re.subn(pattern, replacement, (ROOT / file).read_text(encoding="utf-8"), count=1)
            if count != 1:
                return f"NOT FOUND: {pattern} in {file}"
            (ROOT / file).write_text(text, encoding="utf-8")
        built = subprocess.run(["cmake", "--build", "--preset", "dev", "-j1", "--target", program], cwd=ROOT, capture_output=True, text=True, check=False)
        if built.returncode != 0:
            return "DOES NOT BUILD\n" + built.stdout[-1500:]
        run = subprocess.run([ROOT / "build/dev/bin" / program, f"--gtest_filter={tests}", "--gtest_brief=1"], capture_output=True, text=True, check=False)
        ran = re.search(r"(\d+) tests? from", run.stdout)
        if ran is None or ran.group(1) == "0":
            return "NO SUCH TEST"
        failed = len(re.findall(r"(?m)^\[  FAILED  \] .*\(\d+ ms\)", run.stdout))
        return f"{'fails' if run.returncode else 'SURVIVES'}: {failed} of {ran.group(1)}"
    finally:
        for file, text in kept.items():
            (ROOT / file).write_text(text, encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true", help="only list the rows that no rule here is of")
    parser.add_argument("hazards", nargs="*", metavar="HAZARD")
    arguments = parser.parse_args()
    rows = hazards()
    bad = 0
    for begin, *_ in RULES:
        if not any(hazard.startswith(begin) for hazard, _ in rows):
            print(f"no row of docs/safety.md begins with '{begin}'")
            bad += 1
    for begin, edits, program, tests in RULES:
        if arguments.list or (arguments.hazards and not any(part in begin for part in arguments.hazards)):
            continue
        said = judge(edits, program, tests)
        bad += not said.startswith("fails")
        print(f"{begin:48} {said} ({tests})", flush=True)
    for hazard, tests in rows:
        if not any(hazard.startswith(begin) for begin, *_ in RULES):
            print(f"{hazard:48} not taken out here; its tests: {tests}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
