#pragma once

#include <algorithm>
#include <functional>

namespace sgf {

/// Number of threads to use for a request: the request itself, or all cores for 0.
/// @throws Error for a negative request.
int ResolveThreads(int requested);

/// Calls body(i) once for every i in [0, count) on at most `threads` threads (0: all cores) and
/// returns when all are done. The split into i must not depend on `threads` where results do.
void ParallelFor(int count, int threads, const std::function<void(int)>& body);

/// ParallelFor() for small bodies: they are handed to threads in batches of a fixed size.
template <class Body>
void ParallelForBatches(int count, int threads, const Body& body) {
  constexpr int kBatch = 32;
  ParallelFor((count + kBatch - 1) / kBatch, threads, [&](int batch) {
    for (int i = batch * kBatch; i < std::min(count, (batch + 1) * kBatch); ++i) body(i);
  });
}

}  // namespace sgf
