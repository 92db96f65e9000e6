#!/usr/bin/env python3
"""Shows that the tests of docs/safety.md hold its rules: takes each rule out of the sources, builds, and expects the tests of its row to fail.

    python3 tests/safety_mutations.py [--list] [HAZARD ...]

HAZARD is a part of a row's first column. It edits the sources of the tree that it stands in, one rule at a time, and puts them back; the
build folders are those of the presets dev, and release for rows whose tests are scripts of tests/system. In the gate with --list alone: the
rest is an hour of building.
Exit code 1: a rule can be taken out unnoticed, or is not where this file looks for it.
"""
import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HAND, SAFETY, MODEL = "clients/haptic/haptic_hand.cpp", "devices/safety.cpp", "clients/haptic/local_model.cpp"
AGE, BRACELET, WORKSPACE = "clients/haptic/answer_age.cpp", "clients/haptic/bracelet.cpp", "clients/haptic/workspace.cpp"
REMOTE, REMOTE_MODEL, REGISTRY, WRITER = "devices/drivers/remote_device.cpp", "devices/drivers/remote_model.cpp", "server/session/session_registry.cpp", "server/session/journal_writer.cpp"
ARMING, GUARDED = "clients/haptic/arming.h", "clients/haptic/guarded_device.h"
STOPS, SIMULATION = "server/session/stop_keeper.cpp", "server/session/session_simulation.cpp"
SCRIPTS = "programs"  # of the release preset; tests are then those of tests/system
FIXTURE, MENTORING = "clients/haptic/virtual_fixture.cpp", "server/session/mentoring.cpp"

# hazard (begin of its row), edits (file, pattern, replacement), program, tests
RULES = [
    ("a trainee's hand obeys another", [("idl/wire/membership.cpp", r"member->hearServer\(\);", ""),
                                        ("idl/wire/membership.cpp", r"next\.server_epoch >= announce\.server_epoch", "next.server_epoch <= announce.server_epoch")],
     "idl_wire_tests", "Membership.BelongsToTheServerOfItsNameThatStartedFirst"),
    ("somebody takes a person's hands", [(REGISTRY, r"  if \(former && !proofs\.seat\)\n\s*return [^;]*;\n", "")],
     "server_session_tests", "SessionRegistryTest.*:SessionServer.AClientThatKnowsThePublicKeyOfASeatAloneEvictsNobody"),
    ("a late or doubled message lifts", [("idl/types/stop_truth.cpp", r"wasCleared\(stop\) \|\| ", "")], "idl_types_tests", "StopTruth.*"),
    ("a client raises the stop without end", [("idl/types/stop_truth.cpp", r"standing_\.size\(\) < kMostClients", "true")], "idl_types_tests", "StopTruth.OfRaisesUnderEverNewNames*"),
    ("a stop is over for its clients", [(STOPS, r"!keeper_ \|\| keeper_->isDone\(number_\)", "true")], "server_session_tests",
     "StopKeeperTest.ARaiseIsPublishedAtOnceAndAClearWhenItIsOnTheDisk"),
    ("a resumed server's messages", [("server/session/session_server.cpp", r"std::max\(by_clock, former \+ 1\)", "(static_cast<void>(former), by_clock)")], "server_session_tests",
     "ResumeTest.AServerThatResumesHasALargerEpochThanAllBeforeIt"),
    ("the forces of a client that has left", [("server/session/contributions.h", r"    for \(const auto& \[object, source\] : found->second\.forces\)[^;]*;\n", "")], "server_session_tests",
     "Contributions.OfAClientThatLeavesNothingWaitsAndItsForcesEnd"),
    ("a device is armed from afar", [(ARMING, r"return armed_ && !stopped_;", "return !stopped_;")], "clients_haptic_tests", "Arming.NothingButThePersonArms"),
    ("a killed server is resumed and moves", [("server/simulation/environment_hands.cpp", r"kGraspReach = 5e-3", "kGraspReach = 5e3")],
     "server_session_tests", "ReturningHand.HoldsItsObjectAgainWhereItHeldIt"),
    ("a recorder that hangs, or a full disk", [(WRITER, r"if \(writePending\(\)\) continue;", "const std::size_t n = writeBatch();\n    for (std::size_t i = 0; publish_ && i < n; ++i) publish_(batch_[i]);\n    if (n == kBatch) continue;"), (WRITER, r"publish_ && i < count;", "publish_ && i < count && !problem();")],
     "server_session_tests", "JournalWriterTest.AReaderThatHangsLeavesNoGapInTheFile:JournalWriterTest.AFullDiskEndsTheFileAndNotTheCopies"),
    ("a client fills the queue", [("server/session/contributions.h", r"waiting\.size\(\) < kMostOfClient", "true"), ("server/session/contributions.h", r" \|\| isFull\(\)", "")],
     "server_session_tests", "Contributions.LeaveHalfOfTheQueueToCommands"),
    ("commands of a stop or a pause wait", [("server/session/command_gate.cpp", r"is_stopped && !in_stop", "is_stopped && in_stop"),
                                            ("server/session/session_simulation.h", r"is_changed = phase_ == RunPhase::kPaused && [^;]*;", "is_changed = false;")],
     "server_session_tests", "CommandGateTest.DuringAnEmergencyStop*:SessionSimulation.CommandsOfAPause*"),
    ("commands of a stop or a pause wait", [("server/session/session_simulation.cpp", r"  output\.commands\.dropped = commands_dropped_;\n", "")], "server_session_tests",
     "SessionServer.ACommandWhoseTickAStopForestallsIsToldWithItsSender"),
    ("a device that is being armed does not", [("clients/haptic/arming_thread.h", r"while \(isUnderWay\(\)\) hear\(\);", "while (isUnderWay()) static_cast<void>(hear);")],
     "clients_haptic_tests", "ArmingThread.*"),
    ("a device that is being armed does not", [(GUARDED, r"handover_\.askWithoutReset\(\);", "static_cast<void>(device_.arm());")], "clients_station_tests", "DeviceStation.FramesStopsAndContacts*"),
    ("a person who is gone counts as there", [("server/session/reception.cpp", r"  dismissUnheard\(\);\n", "")], "server_session_tests", "SessionServer.WhoEnds*"),
    ("a clear meets a raise", [("server/session/command_translator.cpp", r"command\.value != context\.newest\.number", "false")], "server_session_tests", "SessionServer.ARaise*"),
    ("motion starts when a stop is cleared", [(REGISTRY, r"  changes_\.push_back\(\{\.kind = ChangeKind::kPause\}\);\n", "")],
     "server_session_tests", "RegistryCommands.AClearedEmergencyStopLeavesTheRunPaused"),
    ("after a gap the hand is thrown", [(HAND, r"workspace_\.shift\(([^;]*)\);", r"workspace_.shift(0.0 * (\1));")], "clients_haptic_tests",
     "ForceReturnOffset.IsSentAndDecaysOutOfContactAlone:*AFreezeIsSoft*:*AfterAGapIsSoft*"),
    ("a force is back at once", [(SAFETY, r"force_starting_ \? std::max\(0\.0, limits_\.start_force_slew \* growth - wall_growth\)", "force_starting_ ? limits_.force_slew * growth - 0.0 * wall_growth")],
     "clients_haptic_tests", "*ForceReturn.AfterAGapIsSoft*"),
    ("it is back before its second", [(SAFETY, r"since_start_ \+= growth;", "since_start_ += 2.0 * growth;")], "clients_haptic_tests", "*ABusyMachineIsSoft*"),
    ("a part of two hands", [(MODEL, r"if \(!\(after - before > [^;]*\) return X_WB;", "static_cast<void>(kRounding);\n  if (before >= 0.0) return X_WB;")],
     "clients_haptic_tests", "LocalModel.SpringsFarFromTheirGoalsComeToRest:ASharedPart.IsCarriedWithoutStepsOfTheForceByWhoHasNoCopyOfTheScene"),
    ("a velocity that a body has", [(MODEL, r"clampNorm\(way, LocalModel::kFarthestExpectation\)", "way")], "clients_haptic_tests", "LocalModel.ExpectsPlanes*"),
    ("a force comes back larger", [(SAFETY, r"clampNorm\(wrench\.force, std::max\(0\.0, startLimit\(\) - wall_\.norm\(\)\)\)", "wrench.force")], "devices_tests",
     "Safety.AForceThatStartsFromNothingIsAtMostThreeNewtonForASecond"),
    ("a second gap comes", [(SAFETY, r"if \(!force_starting_\)\n", "if (!starting())\n"), (SAFETY, r"if \(!torque_starting_\) settled", "if (!starting()) settled")], "devices_tests",
     "Safety.A*IsFreeWhile*"),
    ("a wrist that stays turned", [(SAFETY, r"\(start < 1\.0 \|\| torque_behind\)", "start < 1.0")], "devices_tests", "Safety.ATorqueThatStartsFromNothing*"),
    ("the wrist turns during a gap", [(SAFETY, r"clampNorm\(wrench\.torque, std::max\(settled_torque_, limits_\.start_torque\)\)", "wrench.torque")], "clients_haptic_tests", "*TorqueReturn*"),
    ("a force request is no number", [(SAFETY, r"if \(!finite\)\s*startFromZero\(\);\s*else if", "if")], "devices_tests", "Safety.AfterARequestThatWasNoNumber*"),
    ("a force request is no number", [("clients/haptic/coupling.cpp", r"proxy\.active && stretch_\.[^;]*;", "proxy.active;")], "clients_haptic_tests", "Coupling.*"),
    ("people see an emergency stop", [(HAND, r"request\.emergency_stop = stopped_;", "request.emergency_stop = !permitted_;")], "clients_haptic_tests", "HandSafety.AStationThatIsNotArmed*"),
    ("its arming button", [(REMOTE_MODEL, r"awaits_release_ \? caps_\.arming : 0U", "0U")], "devices_tests", "*AnArmingButtonThatWasHeld*"),
    ("its arming button", [(REMOTE_MODEL, r"  awaits_release_ = true;\n  target_", "  target_")], "devices_tests", "RemoteDeviceTest.*NextOne"),
    ("the hand of a seat that was taken over", [("server/session/input_buffer.h", r"has_come && hand\.newest\.value\(\)\.station == station", "has_come")], "server_session_tests",
     "InputBuffer.AReadingOfTheFormerStation*"),
    ("an object that was held still", [(MODEL, r"!manifold_\.frozen && ", "")], "clients_haptic_tests", "*AFreezeIsSoft*"),
    ("the held object jumps", [(MODEL, r"!same \|\| anyBody", "anyBody")], "clients_haptic_tests", "*AJumpOfTheHeldObjectIsSoft*"),
    ("it jumps while contacts are late", [(HAND, r"proxy\.discontinuous \|\|\s*", "")], "clients_haptic_tests", "*AJumpWhileContactsAreLateIsSoft*"),
    ("a gap, or a station that is too slow", [(HAND, r"kSceneCopy && ages;", "kSceneCopy && ages && !ages;")], "clients_haptic_tests",
     "ForceReturnOfCopy.AGapBesideAnEdge*"),
    ("a gap, or a station that is too slow", [("clients/haptic/switch_slew.h", r"force_growth_ \* dt", "100.0 * force_growth_ * dt")], "clients_haptic_tests",
     "ForceModelSwitch.AModelThatAsksForMore*"),
    ("motors that are hot", [("clients/station/device_station.cpp", r"  if \(arm\.hand\) arm\.heat = arm\.hand->heat\(\);\n", "")], "clients_station_tests",
     "DeviceStation.MotorsThatAreHot*"),
    ("a station comes back with copies", [("clients/haptic/copy_loader.cpp", r"(  if \(!loaded\(\) \|\| loading_\.valid\(\)\) return;\n)", r"\1  return renew();\n")], "clients_haptic_tests",
     "CopyLoaderTest.CopiesForANewSeat*"),
    ("a press from before a raise", [("clients/haptic/servo_loop.cpp", r"(  for \(; presses_[^\n]*\n)(  receiveAll\(now\);\n)", r"\2\1")], "clients_haptic_tests", "ServoLoop.APressThatCame*"),
    ("a press while another arm", [("clients/haptic/device_handover.h", r"if \(\(asked & ~served_\) == 0\) asked_\.compare_exchange_strong\([^;]*;", "asked_.store(0);\n    static_cast<void>(asked);")],
     "clients_haptic_tests", "DeviceHandover.*"),
    ("commands that wait delay the stop", [(REGISTRY, r"changes_\.insert\(earlier\.base\(\), ", "changes_.insert((static_cast<void>(earlier), changes_.end()), ")], "server_session_tests",
     "RegistryCommands.ChangesThatWait*"),
    ("the end of an earlier stop", [(REGISTRY, r"changes_\.insert\(earlier\.base\(\), ", "changes_.insert((static_cast<void>(earlier), changes_.begin()), ")], "server_session_tests",
     "RegistryCommands.AStopIsNotLifted*"),
    ("a stop file out of reach", [("server/session/stop_file.cpp", r"errno == ENOENT", "errno != 0")], "server_session_tests", "StopFile.*"),
    ("a stop that was cleared stops", [("clients/command/stop_raiser.cpp", r"if \(raise != 0\) static_cast<void>\(stops_->dispose\([^;]*;", "static_cast<void>(raise);")], "clients_command_tests", "StopRaiserTest.*"),
    ("raises of a client that were cleared", [("idl/types/stop_truth.cpp", r"found->second\.counter >= raise\.counter", "found->second.counter == raise.counter")], "server_session_tests",
     "StopKeeperTest.WhoJoinsLateHearsThatAllRaisesOfAClientThatRepeatsThemAreCleared"),
    ("a station that has heard a clear", [(STOPS, r"if \(const StopChange change = raise\(again\)\) publish\(again, change\);", "")], "server_session_tests",
     "StopKeeperTest.WhoHasHeardAClearThatWasNotKeptIsToldThatTheStopStandsAgain"),
    ("two programs move one hand", [("idl/wire/membership.cpp", r"is_displaced_ = notice\.reason == kSeatTaken;", "")], "idl_wire_tests", "Membership.AProgramWhose*"),
    ("two objects begin to collide", [("server/simulation/environment.cpp", r"if \(isPulled\(object\) && !has_jumped\) beginEpoch\(object\);", "static_cast<void>(has_jumped);")],
     "clients_haptic_tests", "HandInPlate.*"),
    ("a hand that is held still", [("server/simulation/environment.h", r"engaged\(motion\) && !motion\.frozen", "engaged(motion)")], "server_simulation_tests",
     "TwoHandsTest.AFrozenHandLetsTheOtherMoveThePart"),
    ("a hand that is held still", [("server/simulation/environment_hands.cpp", r"    motion\.X_HO = motion\.X_WH\.inverse\(\) \* object\.X_WO;\n  \}\n\}\n\n/// Another", "  }\n}\n\n/// Another")],
     "server_simulation_tests", "TwoHandsTest.AHandThatWasFrozenHoldsThePartWhereTheOtherHasBroughtItWithoutAPull"),
    ("a device keeps its last force", [(GUARDED, r" \|\| \(is_silent && finish_disarms_\)", "")], "clients_haptic_tests", "HandSafety.AtTheEndTheForceFallsToZeroAndThenTheDeviceIsDisarmed"),
    ("a device keeps its last force", [(BRACELET, r"write\(command, finishing_\)", "write(command, false)")], "clients_haptic_tests", "Bracelet.IsSilentAndDisarmedAtTheEnd"),
    ("a button that is held", [("clients/station/device_station.cpp", r"arm\.pressed = \(hand[^;]*;", "arm.pressed = false;")], "clients_station_tests",
     "DeviceStation.AButtonThatIsHeldOverARejoinIsNotPressed"),
    ("a station comes back to another scene", [("idl/wire/membership.cpp", r"if \(announce_\.scenario_hash != [^{;]*\)\n", "if (false)\n")], "idl_wire_tests",
     "Membership.DoesNotRejoinASessionOfAnotherScenario"),
    ("a body that it touches jumps", [(MODEL, r"!same \|\| anyBodyJumped\(manifold_, manifold\)", "!same || (anyBodyJumped(manifold_, manifold) && same && !same)"),
                                       (MODEL, r"jumped_at > stepped_tick_", "jumped_at > stepped_tick_ + 1'000'000")],
     "clients_haptic_tests", "*AJumpOfTheBodyItTouchesIsSoft*"),
    ("a body that is not listed jumps", [(MODEL, r"isElsewhere\(contact, world\) \|\|", "")], "clients_haptic_tests", "ForceOfAStalePlane.*"),
    ("a device stops giving readings", [("clients/haptic/haptic_hand.h", r"std::max\(answers_\.excess\(\), reading_age_\)", "answers_.excess()")], "clients_haptic_tests", "DeviceWithoutReadings.ItsForceFades*"),
    ("a device stops giving readings", [(HAND, r"readings_lost_ = readings_lost_ \|\| ", "readings_lost_ = ")], "clients_haptic_tests", "DeviceWithoutReadings.AfterAFault*"),
    ("a device that paces the loop is silent", [("idl/threads/cyclic_thread.cpp", r"\(has_come \? kPatience : 0\)", "(has_come ? 1000 : 1000)")], "clients_haptic_tests", "ServoThread.ADeviceThatIsSilent*"),
    ("readings of a device that paces", [("idl/threads/cyclic_thread.cpp", r"due - period / 4", "due - period")], "clients_haptic_tests", "ServoThread.AReadingThatIsEarly*"),
    ("a body that it touches jumps", [(MODEL, r"jumped_at > stepped_tick_", "jumped_at > stepped_tick_ + 1'000'000")], "clients_haptic_tests",
     "*AJumpOfABodyThatIsNotListedIsSoft*:LocalModel.ABodyThatComesBack*"),
    ("a force begins while a person is not ready", [(SAFETY, r"(  \} else \{\n)    startFromZero\(\);\n", r"\1"), (SAFETY, r"(  braking_ = false;\n)  startFromZero\(\);\n", r"\1"),
                                                    (HAND, r"permitted_ &&\s*safety_\.forcesOn\(\) &&", "")], "clients_haptic_tests", "*AStopIsSoftOnceThePersonHasPressed*"),
    ("the offset moves what a part touches", [(HAND, r"step\(p_DH, hold, dt\)", "step(p_DH, false && hold, dt)")], "clients_haptic_tests", "ForceReturnOffset.StaysInContact"),
    ("a coupling is stiffer", [(REGISTRY, r"return \{least\(offered\.translational[^;]*;", "static_cast<void>(least);\n  static_cast<void>(hand);\n  return offered;")], "server_session_tests",
     "SessionRegistryTest.ACouplingIsAsStiffAsItsDeviceAllowsUnlessTheScenarioWantsLess"),
    ("a coupling is stiffer", [(SAFETY, r"const double stiffness_factor = [^;]*;", "const double stiffness_factor = 1.0;")], "devices_tests",
     "Safety.ScalesAForceToThePassiveStiffnessOfTheDevice"),
    ("contacts arrive and are old", [(AGE, r"  if \(answered == answered_\) return;\n", ""), (AGE, r"read\.seq == answered \? read\.at : -kNever", "read.seq == answered ? now_ : now_")],
     "clients_haptic_tests", "HandSafety.TheAgeOfContactsIsThatOfTheInput*"),
    ("the station itself stood still", [(AGE, r"now_ \+= dt;", "now_ += 1e-3 + 0.0 * dt;")], "clients_haptic_tests", "HandSafety.TheAgeOfContactsCountsTheTimeThatACycleTook"),
    ("the station itself stood still", [(SAFETY, r"const double growth = std::min\(dt, kLongestGrowth\);\n  // while a force", "const double growth = dt;\n  // while a force")], "devices_tests",
     "Safety.ALongStepLetsAForceGrowAsTwoMilliseconds"),
    ("the person has let go", [(HAND, r"  request\.dead_man_held = deadManHeld\(\);\n", "")], "clients_haptic_tests", "HandSafety.AReleasedDeadManSwitch*"),
    ("a device that is brought back", [(HAND, r"declutched_ = \(device_state_\.buttons & [^;]*;", "declutched_ = false;")], "clients_haptic_tests", "*ADeclutchedDeviceMovesAlone*"),
    ("a device that is brought back", [(HAND, r"if \(!declutched_\) anchor", "anchor")], "clients_haptic_tests", "*ADeclutchedDeviceMovesAlone*"),
    ("a stopped arm falls", [(GUARDED, r"  device_\.write\(command\);([^\n]*)\n    if \(safety_\.wantsDisarm\(\) \|\| ([^\n]*)\) device_\.disarm\(\);", r"  if (safety_.wantsDisarm()) return device_.disarm();\n  device_.write(command);")],
     "clients_haptic_tests", "HandSafety.A*Brakes*:HandSafety.An*Brakes*"),
    ("contact and end of the workspace", [(SAFETY, r"wall_ \* \(1\.0 - std::clamp\([^;]*;", "wall_;")], "devices_tests", "*WallBesideContactOf.IsNoStiffer*"),
    ("contact and end of the workspace", [("devices/safety_rules.cpp", r"return std::min\(left, limits\.wall_stiffness\);", "return std::max(left, limits.wall_stiffness);")], "devices_tests",
     "*WallBesideContactOf.IsNoStiffer*"),
    ("the end of the workspace pulls", [(SAFETY, r"left \* moved", "left * (p_DH.norm() - wall_distance_ + 0.0 * moved)"), ("devices/safety_rules.cpp", r"kSmallForce = 0\.01", "kSmallForce = 1e-6")],
     "devices_tests", "WorkspaceWall.*"),
    ("armed at the end of the workspace", [(SAFETY, r"  wall_ = slewLimited\([^;]*;", "  wall_ = wallForce(p_DH, limits_);")],
     "clients_haptic_tests", "HandSafety.TheEndOfTheWorkspaceRampsAfterArming"),
    ("the bracelet vibrates on", [(SAFETY, r"request\.restart \? 0\.0 : ageFactor\(request\.age, limits_\)", "request.restart ? 0.0 : 1.0")], "clients_haptic_tests", "Bracelet.*"),
    ("the bracelet vibrates on", [(BRACELET, r"  request\.emergency_stop = stopped_;\n", "")], "clients_haptic_tests", "Bracelet.*"),
    ("a hand falls to the end of its workspace", [(SAFETY, r"return inRamp\(\) \? clampNorm\([^;]*;", "return wall;"), (SAFETY, r"force_starting_ \|\| late_ \|\| wall_since_", "wall_since_")], "devices_tests",
     "Safety.AHandThatFallsToTheEndOfItsWorkspaceInAGapIsMetSoftly"),
    ("a hand falls to the end of its workspace", [(SAFETY, r"if \(wall_was_slow_ && [^;]*;", "")], "devices_tests", "Safety.TheEndOfTheWorkspace*"),
    ("a link whose delay swings", [("clients/haptic/gap_backoff.h", r"fresh_time_ >= wait_", "true")], "clients_haptic_tests", "GapBackoff.*:ForceReturnAfterManyGaps.*"),
    ("forces come on while contacts are late", [(SAFETY, r" \|\| \(late_ && !late\) \|\| \(late && starting\(\)\)", "")], "devices_tests",
     "Safety.ForcesThatComeOnWhileContactsAreLateWaitUntilTheyAreFresh"),
    ("a loop that stood still shifts", [(WORKSPACE, r"  dt = std::min\(dt, kLongestStep\);\n", "  static_cast<void>(kLongestStep);\n")], "clients_haptic_tests", "Workspace.ALongStepCountsAsTenMilliseconds"),
    ("old answers after a gap", [(AGE, r"(now_ - window_began_ > kWindow) &&\s*delays_\[0\] < kNever", r"\1")], "clients_haptic_tests", "AnswerAge.AfterALongGapOldAnswersAreNotFresh"),
    ("a stop comes while a device is being armed", [(GUARDED, r"    if \(!permitted\) handover_\.withdraw\(\);\n", "")], "clients_haptic_tests", "HandSafety.AStopBetweenPressAndArmingLeavesTheDeviceUnarmed"),
    ("an opened clutch is closed", [(HAND, r"  device_state_\.fault = devices::DeviceFault::kNone;\n  device_state_\.F_Ho_D_measured = \{\};\n", "")], "clients_station_tests",
     "DeviceStation.ASimulatedPersonResetsAnOpenClutchAfterTwoSeconds"),
    ("a program that moves a hand (`remote`) hangs", [(REMOTE_MODEL, r"    target_\.buttons = 0;\n", "")], "devices_tests",
     "RemoteDeviceTest.ASilentPeerHasReleasedTheDeadMansSwitchAndMakesRoomLater"),
    ("it throws the hand across", [(REMOTE_MODEL, r"clampNorm\(share \* off\.translation, [^)]*\)", "share * off.translation")], "devices_tests", "RemoteDeviceTest.FollowsItsPeerAtABoundedSpeedAndShowsIt"),
    ("it sends nonsense", [(REMOTE, r"if \(!target\) return dropPeer\(\);", "if (!target) continue;")], "devices_tests", "RemoteDeviceTest.AMessageThatCannotBeUnderstoodEndsTheConnection"),
    ("a fault resets itself", [(GUARDED, r"(?m)^    handover_\.ask\(\);", "    handover_.ask();\n  static_cast<void>(handover_.serve(device_));")], "clients_haptic_tests", "HandSafety.TheLoopNeitherArmsNorResetsADevice"),
    ("arming blocks the loop", [(GUARDED, r"(?m)^    handover_\.ask\(\);", "    handover_.ask();\n  static_cast<void>(handover_.serve(device_));\n  handover_.handBack();")], "clients_haptic_tests",
     "HandSafety.TheLoopNeitherArmsNorResetsADevice"),
    ("an instructor's hand jumps", [(FIXTURE, r"clampNorm\(p_HF_W - p_HA_W, moved\)", "clampNorm(p_HF_W - p_HA_W, 1e3 + moved)"),
                                     (FIXTURE, r"translation\(\) - p_WF_, moved\)", "translation() - p_WF_, 1e3 + moved)")], "clients_haptic_tests",
     "VirtualFixture.GrowsByTwentyNewtonsASecondAndStaysBelowItsLimit:VirtualFixture.AJumpOfTheFixtureIsNoJumpOfTheForce"),
    ("who holds against a fixture", [(FIXTURE, r"  p_HA_W = clampNorm\([^;]*;\n", "")], "clients_haptic_tests", "VirtualFixture.AHandThatIsLetGoOfIsNotThrown"),
    ("a fixture adds energy", [(FIXTURE, r"wrench\.force -= damping", "wrench.force += damping")], "clients_haptic_tests", "*VirtualFixtureEnergy.ACycleOfTheHandTakesEnergyAndGivesNone*"),
    ("a hand that is led, or an unstable loop", [("devices/safety_rules.cpp", r"const double share = [^;]*;", "const double share = 1.0;")], "devices_tests",
     "Safety.TheDampingOfAHandThatIsLedDoesNotChatter"),
    ("contact and fixture together", [(HAND, r"    request\.stiffness \+= coupling_\.stiffness\(\);\n", "")], "clients_haptic_tests",
     "*SpringsInParallelAreWithinWhatTheDeviceRendersStably*"),
    ("the instructor's station dies", [(FIXTURE, r"age_ <= kStaleAt &&", "")], "clients_haptic_tests", "*VirtualFixtureEnd.*"),
    ("the instructor's station dies", [(MENTORING, r" && output\.ages\[hand\.value\] <= Mentoring::kSilent", "")], "server_session_tests",
     "MentoringTest.IsOffWhileTheInstructorsHandIsSilentOrHeldStill"),
    ("guidance begins again", [(MENTORING, r"  if \(output\.emergency_stop\) return [^;]*;\n", "")], "server_session_tests",
     "MentoringTest.EndsForGoodWhenTheInstructorLeavesOrAStopIsEngaged"),
    ("a stop leaves the fixture's force", [(HAND, r"    fixture_\.restart\(\);\n(    switch_slew_)", r"\1")], "clients_haptic_tests",
     "*AStopTakesItsForceAtOnceAndAfterwardsItBeginsFromZero*"),
    ("two instructors pull", [(MENTORING, r"  if \(auto free = conflict[^;]*;[^;]*;\n", "")], "server_session_tests", "MentoringTest.AHandIsGuidedByOneOther"),
    ("two servers move one hand", [("server/session/server_announcement.cpp", r"if \(epoch > content_\.server_epoch\)", "if (epoch > content_.server_epoch && epoch == 0)")], SCRIPTS,
     "trust_test.Identity.test_an_old_server_that_was_stopped_and_continues_ends_itself"),
    ("a stranger leads the run", [(REGISTRY, r"\(role->needs_key \|\| key_of_all_\) && !proofs\.key", "key_of_all_ && !proofs.key")], SCRIPTS,
     "trust_test.Identity.test_instructors_and_admins_need_the_key_and_are_told_so"),
    ("nobody can stop the devices at the keys", [("clients/command/keys.cpp", r"(if \(key == kEmergencyKey\) \{\n\s*)raise\(\);", r"\1")], SCRIPTS,
     "trust_test.EmergencyStop.test_with_a_wrong_key_the_space_bar_still_raises_it"),
    ("a command that was given before the stop", [("clients/command/keys.cpp", r"dropKeys\(\"the emergency stop came after it\"\);", "")], SCRIPTS,
     "trust_test.EmergencyStop.test_keys_that_wait_are_not_sent_after_the_space_bar"),
    ("nobody can stop the devices", [("clients/haptic/station_stops.cpp", r"if \(!change\) return;", "if (stop.who != \"server\" || !change) return;")], SCRIPTS,
     "trust_test.EmergencyStop.test_a_raise_reaches_the_devices_although_the_server_hangs_and_stands_when_it_continues"),
    ("a restart of the server lifts", [(STOPS, r"  truth_ = std::move\(\*kept\);\n", "")], SCRIPTS,
     "trust_test.EmergencyStop.test_a_stop_stands_over_a_killed_server_although_nobody_repeats_it"),
    ("a resumed session has forgotten", [(STOPS, r"  truth_ = std::move\(\*kept\);\n", ""), ("server/session/session_server.cpp", r"if \(simulation_\.emergencyStop\(\)\) wire_", "if (false) wire_")],
     SCRIPTS, "resume_test.KilledServer.test_a_stop_that_only_the_journal_has_stands_too"),
    ("forces are to stop for a moment", [(SIMULATION, r"forces_frozen_ = change\.value != 0\.0;", "forces_frozen_ = false;")], "server_session_tests",
     "SessionSimulation.FrozenForcesHoldHandsStillWhileStepsGoOn"),
    ("a removed person's hands", [(REGISTRY, r"  seat\.is_closed = true;\n", "")], "server_session_tests",
     "SessionRegistryTest.WhoIsRemovedLeavesAndDoesNotGetTheSeatAgain"),
    ("a key pressed by mistake", [("clients/command/keys.cpp", r"command && needsConsent\(\*command\)", "command && needsConsent(*command) && key == 0")], SCRIPTS,
     "trust_test.EmergencyStop.test_space_is_emergency_and_no_other_key_ends_a_run_by_itself"),
    ("a link asks for limits", [(SIMULATION, r"limits_\.freeze, most_freeze\)", "limits_.freeze, 1000 * most_freeze)")], "server_session_tests",
     "SessionSimulation.NoHandGoesOnForLongerThanTheBound*"),
    ("a link asks for limits", [("clients/haptic/limit_chooser.cpp", r"kFreezeTicks, kMostFreezeTicks\)", "kFreezeTicks, 100 * kMostFreezeTicks)")], "clients_haptic_tests",
     "LimitChooser.NoLinkHoweverBad*"),
    ("jitter of the link excuses", [("clients/haptic/answer_age.h", r"std::min\(jitter, kLongestJitter\)", "jitter")], "clients_haptic_tests",
     "AnswerAge.JitterThatWasMeasuredIsNoGapUpToItsBound"),
    ("on a machine that is overloaded", [("clients/command/stop_raiser.cpp", r"\(is_nobody_there && (elapsed >= patience\.to_find)\)", r"(\1)")], "clients_command_tests", "StopRaiserTest.ARaise*"),
    ("a link gets so long", [(AGE, r"delay\(\) > \([^;]*;", "0.0 * since_last;")], "clients_haptic_tests",
     "*OverALinkTooLongForContacts*:AnswerAge.ALinkIsTooLong*"),
    ("two hands that are tied", [(MENTORING, r"std::min\(kMutualStiffness, [^;]*;", "kMutualStiffness + 0.0 * round_trip;")], "server_session_tests",
     "MentoringTest.TiesThemTheMoreSoftlyTheLongerTheWay"),
]


def hazards() -> list[tuple[str, str]]:
    """Hazard and tests of each row of the tables."""
    rows = re.findall(r"(?m)^\| (.+?) \| .+? \| .+? \| (.+?) \|$", (ROOT / "docs/safety.md").read_text(encoding="utf-8"))
    return [(hazard, tests) for hazard, tests in rows if "`" in tests and hazard != "hazard"]


def judge_script(test: str) -> str:
    run = subprocess.run([sys.executable, "-W", "ignore", "-m", "unittest", test], cwd=ROOT / "tests/system", capture_output=True, text=True, check=False,
                         env={**os.environ, "TENON_PROGRAMS": str(ROOT / "build/release/bin"), "TENON_CACHE": str(ROOT / "build/release/test_cache")})
    if not re.search(r"(?m)^Ran 1 test", run.stderr) or "ModuleNotFoundError" in run.stderr:
        return "NO SUCH TEST"
    return "fails" if run.returncode else "SURVIVES"


def judge(edits: list[tuple[str, str, str]], program: str, tests: str) -> str:
    """What became of the tests without the rule."""
    kept = {file: (ROOT / file).read_text(encoding="utf-8") for file, _, _ in edits}
    try:
        for file, pattern, replacement in edits:
            text, count = re.subn(pattern, replacement, (ROOT / file).read_text(encoding="utf-8"), count=1)
            if count != 1:
                return f"NOT FOUND: {pattern} in {file}"
            (ROOT / file).write_text(text, encoding="utf-8")
        preset = "release" if program == SCRIPTS else "dev"
        built = subprocess.run(["cmake", "--build", "--preset", preset, "-j1", "--target", program], cwd=ROOT, capture_output=True, text=True, check=False)
        if built.returncode != 0:
            return "DOES NOT BUILD\n" + built.stdout[-1500:]
        if program == SCRIPTS:
            return judge_script(tests)
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
    parser.add_argument("--list", action="store_true", help="only say which rules are not where this file looks for them, and list the rows that no rule here is of")
    parser.add_argument("hazards", nargs="*", metavar="HAZARD")
    arguments = parser.parse_args()
    rows = hazards()
    bad = 0
    for begin, *_ in RULES:
        if not any(hazard.startswith(begin) for hazard, _ in rows):
            print(f"no row of docs/safety.md begins with '{begin}'")
            bad += 1
    for begin, edits, _, _ in RULES:
        for file, pattern, _ in edits:
            if not re.search(pattern, (ROOT / file).read_text(encoding="utf-8")):
                print(f"{begin:48} NOT FOUND: {pattern} in {file}")
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
