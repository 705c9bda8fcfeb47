#pragma once

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <span>
#include <string>
#include <string_view>
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
/// be a number, bool, string, an enum with EnumNames(), a vector of those, nested options, or a
/// vector of options.
namespace sgf {

template <class T>
concept OptionsStruct = requires(T t) {
  t.VisitFields([](auto&&...) {});
};

template <class T>
concept OptionsList = OptionsStruct<typename T::value_type>;

/// One line of the documentation of an options struct.
struct OptionDoc {
  std::string name;           ///< dotted for nested options
  std::string default_value;  ///< as it would stand in YAML
  std::string unit;           ///< empty for pure numbers and names
  std::string text;
};

/// The name of an enum's value, as EnumNames() has it.
template <class T>
std::string EnumName(T value) {
  for (const auto& [name, v] : EnumNames(value))
    if (v == value) return name;
  return "?";
}

namespace options_internal {

inline std::string At(const std::string& file, const YAML::Node& node) {
  return node.Mark().is_null() ? file : fmt::format("{}:{}", file, node.Mark().line + 1);
}

template <class T>
std::string FormatValue(const T& value) {
  if constexpr (OptionsStruct<T>) {
    std::string text;
    T(value).VisitFields([&](const char* name, auto& field, const char*, const char*) {
      text += fmt::format("{}{}: {}", text.empty() ? "" : ", ", name, FormatValue(field));
    });
    return "{" + text + "}";
  } else if constexpr (std::is_enum_v<T>) {
    return EnumName(value);
  } else if constexpr (std::is_same_v<T, std::string>) {
    return value;
  } else if constexpr (requires { typename T::value_type; }) {
    std::string text = "[";
    for (const auto& v : value) text += (text.size() > 1 ? ", " : "") + FormatValue(v);
    return text + "]";
  } else if constexpr (std::is_floating_point_v<T>) {
    return std::isinf(value) ? (value < 0 ? "-.inf" : ".inf") : fmt::format("{}", value);
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

/// The items of a list that a flag of a program or a line of an ini file gives as text, "1, 2" or
/// "[1, 2]".
inline YAML::Node ListOfText(std::string_view text) {
  constexpr std::string_view kBlank = " \t";
  const auto trim = [&](std::string_view t) {
    const size_t first = std::min(t.find_first_not_of(kBlank), t.size());
    return t.substr(first, t.find_last_not_of(kBlank) + 1 - first);
  };
  text = trim(text);
  if (text.starts_with('[') && text.ends_with(']')) text = trim(text.substr(1, text.size() - 2));
  YAML::Node list(YAML::NodeType::Sequence);
  for (size_t begin = 0, end = 0; !text.empty() && end != std::string_view::npos; begin = end + 1) {
    end = text.find(',', begin);
    list.push_back(std::string(trim(text.substr(begin, end - begin))));
  }
  return list;
}

/// Whether a field is a list of plain values.
template <class T>
concept PlainList = std::is_same_v<T, std::vector<typename T::value_type>>;

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
      if constexpr (PlainList<T>)
        value = (node.IsScalar() ? ListOfText(node.Scalar()) : node).template as<T>();
      else
        value = node.as<T>();
    } catch (const YAML::Exception&) {
      throw Error(At(file, node),
                  fmt::format("cannot read '{}' as the value of {}", YAML::Dump(node), key));
    }
  }
}

template <class List>
void ReadOptionsList(const YAML::Node& node, const std::string& key, const std::string& file,
                     List& list);

template <class List>
YAML::Node WriteOptionsList(const List& list);

}  // namespace options_internal

/// Sets the fields named in a YAML map; others keep their value. A list of options is replaced as a
/// whole.
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
    using T = std::remove_cvref_t<decltype(value)>;
    if constexpr (OptionsStruct<T>)
      ReadOptions(node, value, file);
    else if constexpr (OptionsList<T>)
      options_internal::ReadOptionsList(node, name, file, value);
    else
      options_internal::ParseValue(node, name, file, value);
  });
  for (const auto& entry : map) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : YAML::Dump(entry.first);
    if (!known.contains(key))
      throw Error(options_internal::At(file, entry.first), fmt::format("unknown key '{}'", key));
  }
}

template <class List>
void options_internal::ReadOptionsList(const YAML::Node& node, const std::string& key,
                                       const std::string& file, List& list) {
  if (!node.IsSequence()) throw Error(At(file, node), fmt::format("{} has to be a list", key));
  list.clear();
  for (const YAML::Node& item : node) {
    if (!item.IsMap())
      throw Error(At(file, item), fmt::format("expected a map of options in {}", key));
    ReadOptions(item, list.emplace_back(), file);
  }
}

/// Sets an option in a YAML map that ReadOptions() is to read. @param name dotted for a nested
/// option.
inline void SetOption(YAML::Node map, const std::string& name, const std::string& value) {
  size_t begin = 0;
  for (size_t dot; (dot = name.find('.', begin)) != std::string::npos; begin = dot + 1)
    map.reset(map[name.substr(begin, dot - begin)]);
  map[name.substr(begin)] = value;
}

/// The resolved options as a YAML map, written beside every run.
template <OptionsStruct O>
YAML::Node WriteOptions(O options) {
  YAML::Node map(YAML::NodeType::Map);
  options.VisitFields([&](const char* name, auto& value, const char*, const char*) {
    using T = std::remove_cvref_t<decltype(value)>;
    if constexpr (OptionsStruct<T>)
      map[name] = WriteOptions(value);
    else if constexpr (OptionsList<T>)
      map[name] = options_internal::WriteOptionsList(value);
    else if constexpr (std::is_enum_v<T>)
      map[name] = options_internal::FormatValue(value);
    else
      map[name] = value;
  });
  return map;
}

template <class List>
YAML::Node options_internal::WriteOptionsList(const List& list) {
  YAML::Node sequence(YAML::NodeType::Sequence);
  for (const auto& item : list) sequence.push_back(WriteOptions(item));
  return sequence;
}

/// Documentation of all fields with the values that `options` holds as defaults. After a list of
/// options come the fields of its items, named "list[].field".
template <OptionsStruct O>
std::vector<OptionDoc> DescribeOptions(O options, const std::string& prefix = "") {
  std::vector<OptionDoc> docs;
  options.VisitFields([&](const char* name, auto& value, const char* unit, const char* text) {
    using T = std::remove_cvref_t<decltype(value)>;
    std::vector<OptionDoc> inner;
    if constexpr (OptionsStruct<T>)
      inner = DescribeOptions(value, prefix + name + ".");
    else
      docs.push_back({prefix + name, options_internal::FormatValue(value), unit, text});
    if constexpr (OptionsList<T>)
      inner = DescribeOptions(typename T::value_type(), prefix + name + "[].");
    std::move(inner.begin(), inner.end(), std::back_inserter(docs));
  });
  return docs;
}

}  // namespace sgf
