#pragma once

#include <exception>
#include <iostream>

#include <benchmark/benchmark.h>

namespace sgf {

/// Runs what has been registered. @return exit code: 2 for an unknown flag.
inline int RunRegistered(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

/// Calls run(argc, argv), which registers benchmarks and ends in RunRegistered().
/// @return its exit code, or 2 and a line on stderr where it throws.
inline int BenchmarkMain(int argc, char** argv, int (*run)(int, char**)) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << argv[0] << ": " << error.what() << '\n';
    return 2;
  }
}

}  // namespace sgf
