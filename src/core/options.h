#pragma once

#include <set>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <yaml-cpp/yaml.h>

#include <sgf/core/error.h>

/// Options are plain structs with defaults. Each has one list of its fields,
///
///     struct FooOptions {
///       int window = 9;
///       template <class V> void VisitFields(V&& visit) {
///         visit("window", window, "px", "side of the square window, odd");
///       }
///     };
///
/// and that list alone drives reading, writing, command-line flags and documentation. A field may
/// be a number, bool, string, an enum with EnumNames(), a vector of those, or nested options.
namespace sgf {

template <class T>
concept OptionsStruct = requires(T t) {
  t.VisitFields([](auto&&...) {});
};

/// One line of the documentation of an options struct.
struct OptionDoc {
  std::string name;           ///< dotted for nested options
  std::string default_value;  ///< as it would stand in YAML
  std::string unit;           ///< empty for pure numbers and names
  std::string text;
};

namespace options_internal {

inline std::string At(const std::string& file, const YAML::Node& node) {
  return node.Mark().is_null() ? file : fmt::format("{}:{}", file, node.Mark().line + 1);
}

template <class T>
std::string FormatValue(const T& value) {
  if constexpr (std::is_enum_v<T>) {
    for (const auto& [name, v] : EnumNames(value))
      if (v == value) return name;
    return "?";
  } else if constexpr (std::is_same_v<T, std::string>) {
    return value;
  } else if constexpr (requires { typename T::value_type; }) {
    std::string text = "[";
    for (const auto& v : value) text += (text.size() > 1 ? ", " : "") + FormatValue(v);
    return text + "]";
  } else {
    return fmt::format("{}", value);
  }
}

template <class T>
std::string KnownNames(T value) {
  std::string names;
  for (const auto& [name, v] : EnumNames(value))
    names += (names.empty() ? "" : ", ") + std::string(name);
  return names;
}

template <class T>
void ParseValue(const YAML::Node& node, const std::string& key, const std::string& file, T& value) {
  if constexpr (std::is_enum_v<T>) {
    const std::string text = node.IsScalar() ? node.Scalar() : "";
    for (const auto& [name, v] : EnumNames(value))
      if (text == name) {
        value = v;
        return;
      }
    throw Error(At(file, node), fmt::format("{} is '{}'; known: {}", key, text, KnownNames(value)));
  } else {
    try {
      value = node.as<T>();
    } catch (const YAML::Exception&) {
      throw Error(At(file, node),
                  fmt::format("cannot read '{}' as the value of {}", YAML::Dump(node), key));
    }
  }
}

}  // namespace options_internal

/// Sets the fields named in a YAML map; others keep their value.
/// @param file what error messages call the source.
/// @throws Error naming file, line and key for an unknown key or an unreadable value.
template <OptionsStruct O>
void ReadOptions(const YAML::Node& map, O& options, const std::string& file) {
  if (!map || map.IsNull()) return;
  if (!map.IsMap()) throw Error(options_internal::At(file, map), "expected a map of options");
  std::set<std::string> known;
  options.VisitFields([&](const char* name, auto& value, const char*, const char*) {
    known.insert(name);
    const YAML::Node node = map[name];
    if (!node) return;
    if constexpr (OptionsStruct<std::remove_cvref_t<decltype(value)>>)
      ReadOptions(node, value, file);
    else
      options_internal::ParseValue(node, name, file, value);
  });
  for (const auto& entry : map) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : YAML::Dump(entry.first);
    if (!known.contains(key))
      throw Error(options_internal::At(file, entry.first), fmt::format("unknown key '{}'", key));
  }
}

/// The resolved options as a YAML map, written beside every run.
template <OptionsStruct O>
YAML::Node WriteOptions(O options) {
  YAML::Node map(YAML::NodeType::Map);
  options.VisitFields([&](const char* name, auto& value, const char*, const char*) {
    using T = std::remove_cvref_t<decltype(value)>;
    if constexpr (OptionsStruct<T>)
      map[name] = WriteOptions(value);
    else if constexpr (std::is_enum_v<T>)
      map[name] = options_internal::FormatValue(value);
    else
      map[name] = value;
  });
  return map;
}

/// Documentation of all fields with the values that `options` holds as defaults.
template <OptionsStruct O>
std::vector<OptionDoc> DescribeOptions(O options, const std::string& prefix = "") {
  std::vector<OptionDoc> docs;
  options.VisitFields([&](const char* name, auto& value, const char* unit, const char* text) {
    if constexpr (OptionsStruct<std::remove_cvref_t<decltype(value)>>) {
      for (auto& doc : DescribeOptions(value, prefix + name + ".")) docs.push_back(std::move(doc));
    } else {
      docs.push_back({prefix + name, options_internal::FormatValue(value), unit, text});
    }
  });
  return docs;
}

}  // namespace sgf
