#pragma once

/// For the few lines that run once for each pixel of each patch: compilers stop inlining in large
/// functions, and only inside is it known how much of a sample or a place is never asked for.
#define SGF_ALWAYS_INLINE [[gnu::always_inline]] inline
