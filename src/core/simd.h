#pragma once

#include <string>
#include <vector>

namespace sgf {

/// Instruction sets that this build has code for and this machine can run, widest first, in
/// Highway's names in lower case ("avx3" is AVX-512).
std::vector<std::string> SimdTargets();

/// Restricts all SIMD code of the process to one instruction set of SimdTargets(); "" lifts the
/// restriction. Results do not depend on it: it serves benchmarks and bug hunts. Not to be called
/// while another thread computes.
/// @throws Error for a name not in SimdTargets().
void RestrictSimd(const std::string& target);

/// Instruction set that the next call will run on.
std::string ActiveSimdTarget();

}  // namespace sgf
