#include <climits>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/image.h>
#include <sgf/io/image_check.h>
#include <sgf/io/read_file.h>

namespace sgf {

cv::Mat ReadImage(const std::filesystem::path& path, int imread_flags) {
  std::string bytes = ReadFile(path);
  if (bytes.size() > INT_MAX) throw Error(path.string(), "is larger than 2 GiB");
  RequireCompleteImage(bytes, path.string());
  const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U, bytes.data());
  cv::Mat image;
  try {
    image = cv::imdecode(encoded, imread_flags);
  } catch (const cv::Exception& error) {
    throw Error(path.string(), "cannot be decoded: " + error.err);
  }
  if (image.empty()) throw Error(path.string(), "cannot be decoded: corrupt image data");
  return image;
}

cv::Mat1b ToGrey(const cv::Mat& image) {
  if (image.channels() == 1) return image;
  cv::Mat1b grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

cv::Mat1b ReadGrey(const std::filesystem::path& path) {
  return ToGrey(ReadImage(path, cv::IMREAD_ANYCOLOR));
}

void WritePng(const std::filesystem::path& path, const cv::Mat& image) {
  const int channels = image.channels();
  const bool fits = (image.depth() == CV_8U || image.depth() == CV_16U) &&
                    (channels == 1 || channels == 3 || channels == 4);
  if (image.empty() || !fits)
    throw Error(path.string(), fmt::format("a PNG cannot hold an image of {}x{} pixels of type {}",
                                           image.cols, image.rows, cv::typeToString(image.type())));
  std::vector<uchar> encoded;
  if (!cv::imencode(".png", image, encoded)) throw Error(path.string(), "cannot be encoded as PNG");
  AtomicFile file(path);
  file.Write({reinterpret_cast<const char*>(encoded.data()), encoded.size()});
  file.Commit();
}

}  // namespace sgf
