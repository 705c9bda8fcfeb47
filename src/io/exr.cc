#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include <Iex.h>
#include <ImathBox.h>
#include <ImathMatrix.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <fmt/format.h>
#include <half.h>

#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/exr.h>
#include <sgf/io/exr_check.h>
#include <sgf/io/fields.h>
#include <sgf/io/read_file.h>

namespace sgf {
namespace {

constexpr const char* kCameraModel = "cameraModel";
constexpr const char* kIntrinsics = "intrinsics";
constexpr const char* kDistortion = "distortion";
constexpr const char* kPose = "worldFromCamera";
constexpr const char* kPinholeRadialTangential = "pinhole radial-tangential";

// The calling thread does all work: threads of our own then go to whole images.
constexpr int kNoThreads = 0;

class MemoryWriter : public Imf::OStream {
 public:
  MemoryWriter() : OStream("memory") {}
  void write(const char bytes[], int count) override {
    const auto size = static_cast<size_t>(count);
    bytes_.resize(std::max(bytes_.size(), position_ + size));
    std::memcpy(bytes_.data() + position_, bytes, size);
    position_ += size;
  }
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  size_t position_ = 0;
};

class MemoryReader : public Imf::IStream {
 public:
  explicit MemoryReader(std::string_view bytes) : IStream("memory"), bytes_(bytes) {}
  bool read(char bytes[], int count) override {
    const auto size = static_cast<size_t>(count);
    if (position_ > bytes_.size() || bytes_.size() - position_ < size)
      throw Iex::InputExc("ends too early: truncated or damaged");
    std::memcpy(bytes, bytes_.data() + position_, size);
    position_ += size;
    return position_ < bytes_.size();
  }
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override { position_ = position; }

 private:
  std::string_view bytes_;
  size_t position_ = 0;
};

// Runs a piece of work with OpenEXR and turns its exceptions into ours.
template <class F>
auto WithOpenExr(const std::string& where, F&& work) {
  try {
    return work();
  } catch (const Iex::BaseExc& error) {
    throw Error(where, error.what());
  }
}

Imf::PixelType PixelTypeOf(ExrStorage storage) {
  switch (storage) {
    case ExrStorage::kHalf:
      return Imf::HALF;
    case ExrStorage::kFloat:
      return Imf::FLOAT;
    default:
      return Imf::UINT;
  }
}

ExrStorage StorageOf(Imf::PixelType type) {
  if (type == Imf::HALF) return ExrStorage::kHalf;
  return type == Imf::FLOAT ? ExrStorage::kFloat : ExrStorage::kUint;
}

int MatrixType(ExrStorage storage) { return storage == ExrStorage::kUint ? CV_32SC1 : CV_32FC1; }

// A slice of a frame buffer that is a whole matrix. The library counts from the upper left pixel of
// the data window, (left, top).
Imf::Slice SliceOf(cv::Mat& plane, Imf::PixelType type, int left = 0, int top = 0) {
  const size_t x_step = plane.elemSize();
  const size_t y_step = plane.step[0];
  char* origin = reinterpret_cast<char*>(plane.data) - left * static_cast<ptrdiff_t>(x_step) -
                 top * static_cast<ptrdiff_t>(y_step);
  return Imf::Slice(type, origin, x_step, y_step);
}

// ---- Writing

void RequireFits(const ExrImage& image, const std::string& name, const ExrChannel& channel,
                 const std::string& where) {
  const cv::Mat& values = channel.values;
  if (values.dims > 2 || values.size() != image.size)
    throw Error(where, fmt::format("channel {} is {}x{}, the image {}x{}", name, values.cols,
                                   values.rows, image.size.width, image.size.height));
  if (values.type() != MatrixType(channel.storage))
    throw Error(where, fmt::format("channel {} is of type {}, its storage needs {}", name,
                                   cv::typeToString(values.type()),
                                   cv::typeToString(MatrixType(channel.storage))));
}

[[noreturn]] void FailRange(const std::string& name, int x, int y, double value,
                            const std::string& where) {
  throw Error(where, fmt::format("channel {} is {} at ({}, {}), beyond the range of its storage",
                                 name, value, x, y));
}

cv::Mat ToHalf(const cv::Mat1f& values, const std::string& name, const std::string& where) {
  cv::Mat1w halves(values.size());
  for (int y = 0; y < values.rows; ++y)
    for (int x = 0; x < values.cols; ++x) {
      const half value(values(y, x));
      if (value.isInfinity() && std::isfinite(values(y, x)))
        FailRange(name, x, y, values(y, x), where);
      halves(y, x) = value.bits();
    }
  return halves;
}

void RequireNotNegative(const cv::Mat1i& values, const std::string& name,
                        const std::string& where) {
  for (int y = 0; y < values.rows; ++y)
    for (int x = 0; x < values.cols; ++x)
      if (values(y, x) < 0) FailRange(name, x, y, values(y, x), where);
}

// Values of a channel as the file stores them.
cv::Mat StoredPlane(const std::string& name, const ExrChannel& channel, const std::string& where) {
  if (channel.storage == ExrStorage::kHalf) return ToHalf(channel.values, name, where);
  if (channel.storage == ExrStorage::kUint) RequireNotNegative(channel.values, name, where);
  return channel.values;
}

void AddText(Imf::Header& header, const std::string& name, const std::string& text,
             const std::string& where) {
  if (header.find(name) != header.end())
    throw Error(where, fmt::format("header attribute {} has a meaning of its own", name));
  header.insert(name, Imf::StringAttribute(text));
}

// OpenEXR's camera space: x right, y up, z forward; points are row vectors.
Imath::M44f WorldToCamera(const SE3& T_world_cam) {
  Eigen::Matrix4d matrix = T_world_cam.Inverse().Matrix();
  matrix.row(1) *= -1;
  Imath::M44f result;
  for (int row = 0; row < 4; ++row)
    for (int col = 0; col < 4; ++col) result[row][col] = static_cast<float>(matrix(col, row));
  return result;
}

void AddCamera(Imf::Header& header, const Camera& c, const std::string& where) {
  AddText(header, kCameraModel, kPinholeRadialTangential, where);
  AddText(header, kIntrinsics, fmt::format("{} {} {} {}", c.fx, c.fy, c.cx, c.cy), where);
  AddText(header, kDistortion, fmt::format("{} {} {} {}", c.k1, c.k2, c.p1, c.p2), where);
}

void AddPose(Imf::Header& header, const SE3& T, const std::string& where) {
  AddText(header, kPose, fmt::format("{} {}", fmt::join(T.p, " "), fmt::join(T.R.coeffs(), " ")),
          where);
  Imf::addWorldToCamera(header, WorldToCamera(T));
}

void RequireCameraSize(const ExrImage& image, const std::string& where) {
  const Camera& camera = *image.camera;
  if (cv::Size(camera.width, camera.height) != image.size)
    throw Error(where, fmt::format("the image is {}x{}, its camera {}x{}", image.size.width,
                                   image.size.height, camera.width, camera.height));
}

Imf::Header HeaderOf(const ExrImage& image, const std::string& where) {
  Imf::Header header(image.size.width, image.size.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  for (const auto& [name, channel] : image.channels)
    header.channels().insert(name, Imf::Channel(PixelTypeOf(channel.storage)));
  if (image.camera) AddCamera(header, *image.camera, where);
  if (image.T_world_cam) AddPose(header, *image.T_world_cam, where);
  for (const auto& [name, text] : image.attributes) AddText(header, name, text, where);
  return header;
}

// The library stores the bytes of a C string, so that a name ends at its first zero byte.
void RequireName(const std::string& name, const std::string& where) {
  constexpr size_t kMaxLength = 255;
  if (name.empty() || name.size() > kMaxLength || name.find('\0') != std::string::npos)
    throw Error(where, fmt::format("{} is no name for a channel or attribute", Printable(name)));
}

void RequireWritable(const ExrImage& image, const std::string& where) {
  if (image.channels.empty() || image.size.empty()) throw Error(where, "has nothing to write");
  for (const auto& [name, channel] : image.channels) {
    RequireName(name, where);
    RequireFits(image, name, channel, where);
  }
  for (const auto& [name, text] : image.attributes) RequireName(name, where);
  if (image.camera) RequireCameraSize(image, where);
}

std::string Encode(const ExrImage& image, const std::string& where) {
  std::vector<cv::Mat> planes;  // that the frame buffer points to
  Imf::FrameBuffer frame;
  for (const auto& [name, channel] : image.channels) {
    planes.push_back(StoredPlane(name, channel, where));
    frame.insert(name, SliceOf(planes.back(), PixelTypeOf(channel.storage)));
  }
  MemoryWriter writer;
  {
    // The file is whole only when its object is gone.
    Imf::OutputFile file(writer, HeaderOf(image, where), kNoThreads);
    file.setFrameBuffer(frame);
    file.writePixels(image.size.height);
  }
  return writer.bytes();
}

// ---- Reading

// Sides of a window, whose corners can be any numbers in a damaged file.
cv::Size WindowSize(const Imath::Box2i& window) {
  const auto side = [](int64_t min, int64_t max) {
    return static_cast<int>(std::min<int64_t>(max - min + 1, std::numeric_limits<int>::max()));
  };
  return {side(window.min.x, window.max.x), side(window.min.y, window.max.y)};
}

// Keeps a damaged header from deciding how much memory is allocated: no method of compression in
// the format makes an image smaller than this.
void RequirePlausibleSize(cv::Size size, size_t channels, size_t file_size,
                          const std::string& where) {
  constexpr int kMaxSide = 1 << 16;
  constexpr size_t kMaxRatio = 1100;
  if (size.width < 1 || size.height < 1 || size.width > kMaxSide || size.height > kMaxSide ||
      channels * static_cast<size_t>(size.width) * static_cast<size_t>(size.height) / kMaxRatio >
          file_size)
    throw Error(where, fmt::format("{}x{} pixels with {} channels in {} bytes: damaged header",
                                   size.width, size.height, channels, file_size));
}

size_t CountChannels(const Imf::ChannelList& channels, const std::string& where) {
  size_t count = 0;
  for (auto it = channels.begin(); it != channels.end(); ++it, ++count)
    if (it.channel().xSampling != 1 || it.channel().ySampling != 1)
      throw Error(where, fmt::format("channel {} is sub-sampled", it.name()));
  if (count == 0) throw Error(where, "has no channel");
  return count;
}

// Makes the image of a header, its channels not yet read.
ExrImage MakeImage(const Imf::Header& header, size_t file_size, const std::string& where) {
  const Imf::ChannelList& list = header.channels();
  ExrImage image;
  image.size = WindowSize(header.dataWindow());
  RequirePlausibleSize(image.size, CountChannels(list, where), file_size, where);
  if (header.dataWindow() != header.displayWindow())
    throw Error(where, "holds a part of a larger image: its data and display windows differ");
  for (auto it = list.begin(); it != list.end(); ++it) {
    const ExrStorage storage = StorageOf(it.channel().type);
    image.channels[it.name()] = {cv::Mat(image.size, MatrixType(storage)), storage};
  }
  return image;
}

void ReadPixels(Imf::InputFile& file, ExrImage& image, const std::string& where) {
  const Imath::Box2i window = file.header().dataWindow();
  Imf::FrameBuffer frame;
  for (auto& [name, channel] : image.channels) {
    const bool uint = channel.storage == ExrStorage::kUint;
    frame.insert(
        name, SliceOf(channel.values, uint ? Imf::UINT : Imf::FLOAT, window.min.x, window.min.y));
  }
  file.setFrameBuffer(frame);
  file.readPixels(window.min.y, window.max.y);
  for (const auto& [name, channel] : image.channels)
    if (channel.storage == ExrStorage::kUint) RequireNotNegative(channel.values, name, where);
}

void ReadTexts(const Imf::Header& header, ExrImage& image) {
  for (auto it = header.begin(); it != header.end(); ++it)
    if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&it.attribute()))
      image.attributes[it.name()] = text->value();
}

// Takes an attribute of N numbers out of the image's texts.
template <size_t N>
std::array<double, N> TakeNumbers(ExrImage& image, const char* name, const std::string& where) {
  const auto node = image.attributes.extract(name);
  if (node.empty()) throw Error(where, fmt::format("has no header attribute {}", name));
  const auto fields = SplitFields(node.mapped(), ' ');
  std::array<double, N> numbers{};
  bool good = fields.size() == N;
  for (size_t i = 0; i < N && good; ++i) {
    const auto number = ParseNumber<double>(fields[i]);
    good = number.has_value();
    numbers[i] = number.value_or(0);
  }
  if (!good)
    throw Error(where, fmt::format("header attribute {} is {}, expected {} numbers", name,
                                   Printable(node.mapped()), N));
  return numbers;
}

std::optional<Camera> TakeCamera(ExrImage& image, const std::string& where) {
  const auto model = image.attributes.extract(kCameraModel);
  if (model.empty()) return std::nullopt;
  if (model.mapped() != kPinholeRadialTangential)
    throw Error(where, fmt::format("unknown camera model {}", Printable(model.mapped())));
  const auto [fx, fy, cx, cy] = TakeNumbers<4>(image, kIntrinsics, where);
  const auto [k1, k2, p1, p2] = TakeNumbers<4>(image, kDistortion, where);
  if (fx <= 0 || fy <= 0)
    throw Error(where,
                fmt::format("focal lengths are {}, {} px; they have to be positive", fx, fy));
  return Camera{image.size.width, image.size.height, fx, fy, cx, cy, k1, k2, p1, p2};
}

std::optional<SE3> TakePose(ExrImage& image, const std::string& where) {
  if (!image.attributes.contains(kPose)) return std::nullopt;
  const auto [px, py, pz, qx, qy, qz, qw] = TakeNumbers<7>(image, kPose, where);
  const SE3 pose{Eigen::Quaterniond(qw, qx, qy, qz), {px, py, pz}};
  if (std::abs(pose.R.norm() - 1) > 1e-9)
    throw Error(where, fmt::format("{} has a quaternion of norm {}", kPose, pose.R.norm()));
  return pose;
}

Imf::Header ReadHeader(MemoryReader& reader, int version) {
  constexpr uint64_t kBehindVersion = 8;
  Imf::Header header;
  reader.seekg(kBehindVersion);
  header.readFrom(reader, version);
  return header;
}

ExrImage Decode(std::string_view bytes, int version, const std::string& where) {
  MemoryReader reader(bytes);
  const Imf::Header header = ReadHeader(reader, version);
  ExrImage image = MakeImage(header, bytes.size(), where);
  reader.seekg(0);
  Imf::InputFile file(reader, kNoThreads);
  ReadPixels(file, image, where);
  ReadTexts(header, image);
  return image;
}

// ---- Layers

std::vector<std::string> ChannelNames(const std::string& layer, std::string_view suffixes) {
  std::vector<std::string> names;
  for (const char suffix : suffixes)
    names.push_back(layer.empty() ? std::string(1, suffix) : fmt::format("{}.{}", layer, suffix));
  return names;
}

}  // namespace

void WriteExr(const std::filesystem::path& path, const ExrImage& image) {
  RequireWritable(image, path.string());
  const std::string bytes =
      WithOpenExr(path.string(), [&] { return Encode(image, path.string()); });
  AtomicFile file(path);
  file.Write(bytes);
  file.Commit();
}

ExrImage ReadExr(const std::filesystem::path& path) {
  const std::string where = path.string();
  const std::string bytes = ReadFile(path);
  const int version = RequireSoundExrHeader(bytes, where);
  ExrImage image = WithOpenExr(where, [&] { return Decode(bytes, version, where); });
  image.camera = TakeCamera(image, where);
  image.T_world_cam = TakePose(image, where);
  image.attributes.erase(kPose);
  return image;
}

void RequireChannels(const ExrImage& image, const std::vector<std::string>& names,
                     const std::string& where) {
  std::vector<std::string> present;
  for (const auto& entry : image.channels) present.push_back(entry.first);
  for (const std::string& name : names)
    if (!image.channels.contains(name))
      throw Error(where,
                  fmt::format("has no channel {}; it has {}", name, fmt::join(present, ", ")));
}

void SetLayer(ExrImage& image, const std::string& layer, const cv::Mat3f& planes,
              std::string_view suffixes, ExrStorage storage) {
  if (image.channels.empty()) image.size = planes.size();
  std::vector<cv::Mat> split;
  cv::split(planes, split);
  for (size_t i = 0; const std::string& name : ChannelNames(layer, suffixes))
    image.channels[name] = {split.at(i++), storage};
}

cv::Mat3f GetLayer(const ExrImage& image, const std::string& layer, const std::string& where,
                   std::string_view suffixes) {
  const std::vector<std::string> names = ChannelNames(layer, suffixes);
  RequireChannels(image, names, where);
  std::vector<cv::Mat> planes;
  for (const std::string& name : names) {
    planes.push_back(image.channels.at(name).values);
    if (planes.back().type() != CV_32FC1)
      throw Error(where, fmt::format("channel {} holds integers", name));
  }
  cv::Mat3f merged;
  cv::merge(planes, merged);
  return merged;
}

}  // namespace sgf
