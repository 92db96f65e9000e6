# Every test of the project. A test program is a room's tests; a ctest test is one of its suites, or one script.
# Labels: `gate` (what decides whether a change lands) or `nightly` (a suite, class or case whose name ends with Nightly or _nightly), and the room.

# What test programs need beside their own room.
if(BUILD_TESTING OR TENON_BUILD_BENCH)
  tenon_room(tests/support LINK idl_types server_structures server_collision)
  set_source_files_properties(tests/support/source_folder.cpp PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON COMPILE_DEFINITIONS
                              TENON_SOURCE="${CMAKE_SOURCE_DIR}")
endif()

set(test_environment TENON_PROGRAMS=${CMAKE_RUNTIME_OUTPUT_DIRECTORY} TENON_CACHE=${CMAKE_BINARY_DIR}/test_cache)
# Suites that compare numbers with a truth are long with a sanitizer, over code that other suites reach too. The gate runs them in
# the release that people run (label `numbers`), and all others with the address sanitizer.
set(suites_of_numbers RealPegs QueryTruth QueryTruthOfRealPairs CouplingWork SheetAtEveryOffset EnvironmentDeterminism Overload
                      FrictionOnASlope FrictionOfAPull FieldSizeTruth RealPairs SlopeLimit FreeFlights Tapers MeshOrigin OwnSteps
                      Stability AgainstWhatStandsStill CopyAgainstWhatStandsStill StiffLoop StiffHand StiffTurn Octree AirGaps Sign
                      FieldSize ValleyPlanes SlidingEdges WallOfASolid)
set(programs_of_numbers server/bake server/collision server/simulation server/session clients/rehearse bench/stability_cells)
set(suites_nightly_here)
set(rooms_nightly_here)
if(TENON_SANITIZE MATCHES address)
  # those behind the numbers are long, and what they reach is reached by shorter suites of their rooms
  set(suites_nightly_here ${suites_of_numbers} WallBesideContactOf TraineeWithEach EngineBayPart)
elseif(TENON_SANITIZE MATCHES thread)  # of one thread
  set(suites_nightly_here EnvironmentCheckpoint JournalDamage MeshOrigin OwnSteps FreeFlights NeverThrough Studs Crossings Tapers)
  # threads of a session and of its stations are in the rehearsal, too
  set(rooms_nightly_here server/session clients/haptic)
  list(APPEND test_environment TSAN_OPTIONS=suppressions=${CMAKE_SOURCE_DIR}/tests/tsan_suppressions.txt)
endif()
# gmock.h is half of a test's time of compilation
add_library(precompiled_tests OBJECT ${CMAKE_BINARY_DIR}/precompiled.cpp)
if(BUILD_TESTING)
  target_link_libraries(precompiled_tests PRIVATE Eigen3::Eigen GTest::gmock)
  target_precompile_headers(precompiled_tests PRIVATE <algorithm> <array> <cstdint> <memory> <span> <string> <vector> <Eigen/Core>
                            <Eigen/Geometry> <gmock/gmock.h> <gtest/gtest.h>)
endif()
add_custom_target(test_programs)
add_custom_target(threaded_tests)  # in the gate
add_custom_target(all_threaded_tests)
add_custom_target(number_tests)

# One program of a room's tests, one ctest test a suite.
function(tenon_tests name)
  cmake_parse_arguments(ARG "THREADS" "" "LINK" ${ARGN})
  string(REPLACE "/" "_" target ${name}_tests)
  file(GLOB sources CONFIGURE_DEPENDS tests/${name}/*_test.cpp)
  if(NOT BUILD_TESTING OR NOT sources)
    return()
  endif()
  add_executable(${target} ${sources})
  target_link_libraries(${target} PRIVATE ${ARG_LINK} tests_support GTest::gmock GTest::gtest_main)
  target_precompile_headers(${target} REUSE_FROM precompiled_tests)
  add_dependencies(test_programs ${target})
  if(ARG_THREADS)
    add_dependencies(all_threaded_tests ${target})
    if(NOT name IN_LIST rooms_nightly_here)
      add_dependencies(threaded_tests ${target})
    endif()
  endif()
  set(nightly_here ${suites_nightly_here})
  if(name IN_LIST rooms_nightly_here)
    set(nightly_here .*)
  endif()
  if(name IN_LIST programs_of_numbers)
    add_dependencies(number_tests ${target})
  endif()
  set(list ${CMAKE_BINARY_DIR}/suites/${target}.cmake)
  add_custom_command(TARGET ${target} POST_BUILD VERBATIM COMMENT "" COMMAND ${CMAKE_COMMAND} -D "PROGRAM=$<TARGET_FILE:${target}>" -D "ROOM=${name}"
                     -D "LIST=${list}" -D "RESULTS=${CMAKE_BINARY_DIR}/results" -D "ENVIRONMENT=${test_environment}" -D "NIGHTLY_SUITES=${nightly_here}"
                     -D "NUMBER_SUITES=${suites_of_numbers}"
                     -P ${CMAKE_SOURCE_DIR}/tests/list_suites.cmake)
  file(WRITE ${CMAKE_BINARY_DIR}/suites/${target}_if_built.cmake "if(EXISTS \"${list}\")\n  include(\"${list}\")\nendif()\n")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${CMAKE_BINARY_DIR}/suites/${target}_if_built.cmake)
endfunction()

foreach(room idl/types idl/record server/structures server/game_control server/check devices devices/simulated clients/simulated_person
             clients/station clients/observer clients/foxglove clients/recorder clients/command clients/report clients/console clients/rehearse
             scenarios/part_generator)
  string(REPLACE "/" "_" target ${room})
  tenon_tests(${room} LINK ${target})
endforeach()
tenon_tests(server/bake LINK server_bake scenarios_part_generator)  # a scene whose solids are known
tenon_tests(server/collision LINK server_collision server_bake scenarios_part_generator)  # baked parts, beside their meshes
tenon_tests(idl/wire LINK idl_wire)  # the bus's own threads are Cyclone's, which no sanitizer of ours can see into
tenon_tests(idl/threads THREADS LINK idl_threads)
tenon_tests(server/simulation THREADS LINK server_simulation server_bake scenarios_part_generator)  # parts with edges
tenon_tests(server/session THREADS LINK server_session clients_haptic)  # a session and its station
tenon_tests(clients/haptic THREADS LINK clients_haptic server_simulation)  # two stations and their server in one process
if(BUILD_TESTING)
  target_compile_options(clients_haptic_tests PRIVATE -Wno-error=free-nonheap-object)  # GCC 12 at -O3, of std::async's result
endif()
foreach(target server_bake_tests server_collision_tests server_session_tests)
  if(TARGET ${target})
    add_dependencies(${target} tenon-bake tenon-parts)  # started by them
  endif()
endforeach()
if(TARGET server_session_tests)
  add_dependencies(server_session_tests tenon-serve)
endif()

# what is generated from the IDL, and what is said to a line of it that cannot be understood
add_test(NAME idl.generate COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/tests/idl/generate_test.py)
set_tests_properties(idl.generate PROPERTIES TIMEOUT 300 LABELS "gate;idl")

# each rule of docs/safety.md is where the script looks that takes it out
add_test(NAME safety.rules COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/tests/safety_mutations.py --list)
set_tests_properties(safety.rules PROPERTIES LABELS "gate;safety")

# a whole session in one process: ends as it should, and without a report of the sanitizer that this preset has
add_test(NAME rehearsal.short COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/tests/rehearsal_test.py)
set_tests_properties(rehearsal.short PROPERTIES TIMEOUT 900 LABELS "gate;rehearsal" ENVIRONMENT "${test_environment}" COST 300)
add_dependencies(threaded_tests tenon-rehearse tenon-parts tenon-bake)
add_dependencies(all_threaded_tests threaded_tests)

# scripts that run the programs as people do; alone those that measure against the clock
set(quiet_scripts session_test faults_test trust_test resume_test network_test link_test car_link_test mentoring_test command_test safety_test station_test
                  console_headset_test console_test endurance_test report_test)
add_executable(link_relay tests/system/link_relay.cpp)  # a network link of theirs
file(GLOB scripts CONFIGURE_DEPENDS tests/system/*_test.py)
foreach(script ${scripts})
  get_filename_component(name ${script} NAME_WE)
  file(STRINGS ${script} nightly REGEX "^class .*Nightly|def test_[a-z_0-9]*_nightly\\(")
  file(STRINGS ${script} gate REGEX "^class [A-Za-z0-9]*\\((unittest\\.)?TestCase")
  list(FILTER gate EXCLUDE REGEX "Nightly")
  foreach(label gate nightly)
    if(${label})
      add_test(NAME system.${name}.${label} COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/tests/run_script.py ${name} ${label}
               WORKING_DIRECTORY ${CMAKE_SOURCE_DIR}/tests/system)
      set_tests_properties(system.${name}.${label} PROPERTIES TIMEOUT 1800 LABELS "${label};system" ENVIRONMENT "${test_environment}" COST 200)
      if(name IN_LIST quiet_scripts)
        set_tests_properties(system.${name}.${label} PROPERTIES RUN_SERIAL ON)
      endif()
    endif()
  endforeach()
endforeach()

# speed is measured here and asserted nowhere
add_executable(tenon-bench-link EXCLUDE_FROM_ALL tests/bench/link/main.cpp)
target_link_libraries(tenon-bench-link PRIVATE idl_wire fmt::fmt CLI11::CLI11)
tenon_room(tests/bench/stability LINK clients_rehearse nlohmann_json::nlohmann_json fmt::fmt)
target_sources(tests_bench_stability PRIVATE tests/bench/engine/table.cpp)
set_target_properties(tests_bench_stability PROPERTIES UNITY_BUILD OFF)
add_executable(tenon-bench-stability tests/bench/stability/main.cpp)
target_link_libraries(tenon-bench-stability PRIVATE tests_bench_stability CLI11::CLI11)
add_dependencies(tenon-bench-stability tenon-bake)  # started by it
tenon_tests(bench/stability_cells LINK tests_bench_stability)
add_test(NAME bench.stability COMMAND tenon-bench-stability --json ${CMAKE_BINARY_DIR}/stability.json --plot ${CMAKE_BINARY_DIR}/stability.svg)
set_tests_properties(bench.stability PROPERTIES TIMEOUT 3600 LABELS "nightly;bench" ENVIRONMENT "${test_environment}" COST 900)
if(BUILD_TESTING)
  add_dependencies(test_programs tenon-bench-stability)
  add_dependencies(bench_stability_cells_tests tenon-bench-stability)
endif()
if(TENON_BUILD_BENCH)
  tenon_room(tests/bench/engine LINK server_bake server_simulation clients_rehearse clients_report tests_support
             scenarios_part_generator fcl PkgConfig::bullet nlohmann_json::nlohmann_json)
  tenon_program(tenon-bench tests/bench/engine/main.cpp tests_bench_engine)
  add_dependencies(tenon-bench tenon-parts tenon-bake tenon-check)  # that it runs
  file(GLOB benchmarks CONFIGURE_DEPENDS tests/bench/*_bench.cpp)
  foreach(source ${benchmarks})
    get_filename_component(name ${source} NAME_WE)
    add_executable(${name} ${source})
    target_link_libraries(${name} PRIVATE tests_support server_simulation tests_bench_engine benchmark::benchmark_main)
  endforeach()
endif()
