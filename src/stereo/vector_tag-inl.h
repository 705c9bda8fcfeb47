// The vectors that the row kernels work on, per instruction set (Highway's -inl.h convention).

#if defined(SGF_STEREO_VECTOR_TAG_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SGF_STEREO_VECTOR_TAG_INL_H_
#undef SGF_STEREO_VECTOR_TAG_INL_H_
#else
#define SGF_STEREO_VECTOR_TAG_INL_H_
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace sgf::stereo::internal {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// At most 32 bytes, with AVX-512 too: the kernels read the right image at every offset, and a load
// of 64 bytes that is not aligned always touches two cache lines. Measured on a machine that splits
// 64-byte operations anyway (Zen 4): 128 disparities, 9 x 9, 1.9 times cv::StereoBM with 64 bytes.
template <class T>
using VectorTag = hn::CappedTag<T, 32 / sizeof(T)>;

}  // namespace HWY_NAMESPACE
}  // namespace sgf::stereo::internal
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
