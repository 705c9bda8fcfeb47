# One function per kind of target, so that every folder of src/ and every test states only its
# sources and what it depends on.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/bin")
set(CMAKE_LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/lib")
set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/lib")

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
# -O3 also vectorises the scalar loops; -DNDEBUG stays as in CMake's default.
set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")

# Sanitizers: any finding ends the program. Two checks of "undefined" are left out, as they double the
# time of the build: the address sanitizer stops at null pointers too, and alignment is only checked
# by instructions that need it. The standard library checks its own preconditions.
set(sanitizers "")
if(SGF_SANITIZE)
  set(sanitizers -fsanitize=address,undefined,float-cast-overflow -fno-sanitize=null,alignment
    -fno-sanitize-recover=all)
endif()
# Fuzzers see which branches of the libraries an input takes.
if(SGF_BUILD_FUZZERS)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "SGF_BUILD_FUZZERS needs clang, not ${CMAKE_CXX_COMPILER}: use preset fuzz")
  endif()
  list(APPEND sanitizers -fsanitize=fuzzer-no-link)
endif()

function(sgf_compile_options target)
  if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # GCC takes files that are compiled as one for headers, in which types of anonymous namespaces would be a fault.
    target_compile_options(${target} PRIVATE -Wno-subobject-linkage)
  endif()
  # Same input, same bits: no contraction to fused multiply-add. errno and floating-point traps are
  # never looked at, and both only block vectorisation; neither flag changes a value.
  target_compile_options(${target} PRIVATE
    -Wall -Wextra -Wpedantic -Wshadow -ffp-contract=off -fno-math-errno -fno-trapping-math
    $<$<CXX_COMPILER_ID:Clang>:-Wno-unknown-pragmas> # GCC ivdep
    $<$<BOOL:${SGF_WARNINGS_AS_ERRORS}>:-Werror>
    ${sanitizers} $<$<BOOL:${SGF_SANITIZE}>:-fno-omit-frame-pointer>)
  target_compile_definitions(${target} PRIVATE $<$<BOOL:${SGF_SANITIZE}>:_GLIBCXX_ASSERTIONS>)
  target_link_options(${target} PRIVATE ${sanitizers})
endfunction()

# Compiles what nearly every file of the project includes once, for position-independent code and for other, and
# has the target use it. -DSGF_PRECOMPILED_HEADERS=OFF suits compiler caches better, and shows missing includes.
function(sgf_precompile_headers target)
  if(NOT SGF_PRECOMPILED_HEADERS)
    return()
  endif()
  get_target_property(independent ${target} POSITION_INDEPENDENT_CODE)
  set(headers sgf_precompiled_headers)
  if(independent)
    string(APPEND headers _pic)
  endif()
  if(NOT TARGET ${headers})
    file(WRITE "${PROJECT_BINARY_DIR}/precompiled_headers.cc" "")
    add_library(${headers} OBJECT "${PROJECT_BINARY_DIR}/precompiled_headers.cc")
    sgf_compile_options(${headers})
    set_target_properties(${headers} PROPERTIES POSITION_INDEPENDENT_CODE "${independent}")
    target_link_libraries(${headers} PRIVATE Eigen3::Eigen opencv_core)
    target_precompile_headers(${headers} PRIVATE
      <algorithm> <cmath> <filesystem> <functional> <map> <memory> <optional> <string> <vector>
      <Eigen/Core> <Eigen/Geometry> <opencv2/core.hpp>)
  endif()
  target_precompile_headers(${target} REUSE_FROM ${headers})
endfunction()

# The presets compile up to eight files of a target as one (CMAKE_UNITY_BUILD), as most of the time goes into the
# same headers and templates. SEPARATE lists sources that stay apart: their own names clash with those of others, or
# they take long.
function(sgf_sources target)
  cmake_parse_arguments(ARG "" "" "SOURCES;SEPARATE" ${ARGN})
  target_sources(${target} PRIVATE ${ARG_SOURCES} ${ARG_SEPARATE})
  set_source_files_properties(${ARG_SEPARATE} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# sgf_library(NAME SOURCES file... [SEPARATE file...] [DEPENDS target...] [PRIVATE_DEPENDS target...])
# makes library libsgf_NAME, used as sgf::NAME, from the calling folder and installs its headers. (The
# target's own name is another, since programs such as sgf_stereo are targets too.)
function(sgf_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;SEPARATE;DEPENDS;PRIVATE_DEPENDS" ${ARGN})
  set(target sgf_library_${name})
  add_library(${target} STATIC)
  sgf_sources(${target} SOURCES ${ARG_SOURCES} SEPARATE ${ARG_SEPARATE})
  add_library(sgf::${name} ALIAS ${target})
  sgf_compile_options(${target})
  target_include_directories(${target} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/include>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PUBLIC ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS})
  set_target_properties(${target} PROPERTIES
    OUTPUT_NAME sgf_${name} EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  sgf_precompile_headers(${target})
  install(TARGETS ${target} EXPORT sgf-${name}-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
    COMPONENT libsgf-dev)
  install(DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}/"
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/sgf/${name} COMPONENT libsgf-dev
    FILES_MATCHING PATTERN "*.h" PATTERN "*.inc")
  set_property(GLOBAL APPEND PROPERTY SGF_PUBLIC_FOLDERS "${CMAKE_CURRENT_SOURCE_DIR}")
endfunction()

# sgf_app(NAME SOURCES file... [DEPENDS target...]) makes and installs executable NAME.
function(sgf_app name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  sgf_compile_options(${name})
  sgf_precompile_headers(${name})
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS})
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT sgf-tools)
endfunction()

# sgf_test(NAME SOURCES file... [SEPARATE file...] [DEPENDS target...] [LABELS label...] [TIMEOUT seconds])
# makes GoogleTest executable NAME and registers it with CTest as one test. Without other labels it
# is a unit test. Target unit_tests builds all unit tests that are not also labelled slow.
function(sgf_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;SEPARATE;DEPENDS;LABELS" ${ARGN})
  if(NOT ARG_LABELS)
    set(ARG_LABELS unit)
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  add_executable(${name})
  sgf_sources(${name} SOURCES ${ARG_SOURCES} SEPARATE ${ARG_SEPARATE})
  sgf_compile_options(${name})
  sgf_precompile_headers(${name})
  target_include_directories(${name} PRIVATE "${PROJECT_SOURCE_DIR}/tests")
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} GTest::gtest GTest::gmock GTest::gtest_main)
  add_test(NAME ${name} COMMAND ${name})
  set_tests_properties(${name} PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT})
  if("unit" IN_LIST ARG_LABELS AND NOT "slow" IN_LIST ARG_LABELS)
    add_dependencies(unit_tests ${name})
  endif()
endfunction()

# sgf_benchmark(NAME SOURCES file... [DEPENDS target...]) makes Google Benchmark executable NAME.
function(sgf_benchmark name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  sgf_compile_options(${name})
  target_include_directories(${name} PRIVATE "${PROJECT_SOURCE_DIR}/tests")
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} benchmark::benchmark)
endfunction()
