#pragma once

#include <functional>

namespace sgf {

/// Number of threads to use for a request: the request itself, or all cores for 0.
/// @throws Error for a negative request.
int ResolveThreads(int requested);

/// Calls body(i) once for every i in [0, count) on at most `threads` threads (0: all cores) and
/// returns when all are done. The split into i must not depend on `threads` where results do.
void ParallelFor(int count, int threads, const std::function<void(int)>& body);

}  // namespace sgf
