// As much of JSON Schema as the files in tools/schemas use: type, const, enum, pattern, required,
// properties, additionalProperties = false, items, minItems, oneOf and $ref within the file. A
// keyword that is not known here is an error, so that no rule is passed over in silence.
#pragma once

#include <algorithm>
#include <fstream>
#include <regex>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace varve::test {

class JsonSchema {
 public:
  using Json = nlohmann::json;

  /// Reads tools/schemas/NAME.json.
  explicit JsonSchema(const std::string& name) {
    std::ifstream file(std::string(VARVE_SCHEMAS) + "/" + name + ".json");
    if (!file) throw std::runtime_error(name + ": no such schema");
    root_ = Json::parse(file);
  }

  /// Everything in which `value` breaks the schema, as "/path: what"; empty if nothing.
  std::vector<std::string> breaches(const Json& value) const {
    std::vector<std::string> out;
    check(root_, value, "", out);
    return out;
  }

 private:
  static bool is_type(const Json& value, const std::string& type) {
    if (type == "null") return value.is_null();
    if (type == "boolean") return value.is_boolean();
    if (type == "string") return value.is_string();
    if (type == "number") return value.is_number();
    if (type == "integer") return value.is_number_integer();
    if (type == "array") return value.is_array();
    if (type == "object") return value.is_object();
    throw std::runtime_error("schema: unknown type " + type);
  }

  void check(const Json& schema, const Json& value, const std::string& path,
             std::vector<std::string>& out) const {
    const std::string shown = value.dump().substr(0, 60);
    for (const auto& [key, rule] : schema.items()) {
      if (key == "$ref") {
        check(root_.at(Json::json_pointer(rule.get<std::string>().substr(1))), value, path, out);
      } else if (key == "type") {
        bool found = false;
        for (const Json& type : rule.is_array() ? rule : Json::array({rule}))
          found = found || is_type(value, type);
        if (!found) out.push_back(path + ": " + shown + " is not of type " + rule.dump());
      } else if (key == "const") {
        if (value != rule) out.push_back(path + ": " + shown + " is not " + rule.dump());
      } else if (key == "enum") {
        if (std::find(rule.begin(), rule.end(), value) == rule.end())
          out.push_back(path + ": " + shown + " is none of " + rule.dump());
      } else if (key == "pattern") {
        if (value.is_string() && !std::regex_search(value.get<std::string>(),
                                                    std::regex(rule.get<std::string>())))
          out.push_back(path + ": " + shown + " does not match " + rule.dump());
      } else if (key == "oneOf") {
        int fitting = 0;
        for (const Json& option : rule) {
          std::vector<std::string> inner;
          check(option, value, path, inner);
          fitting += inner.empty() ? 1 : 0;
        }
        if (fitting != 1) out.push_back(path + ": " + shown + " fits not exactly one of oneOf");
      } else {
        check_parts(schema, key, rule, value, path, out);
      }
    }
  }

  void check_parts(const Json& schema, const std::string& key, const Json& rule, const Json& value,
                   const std::string& path, std::vector<std::string>& out) const {
    static const std::set<std::string> silent{"$schema", "$defs", "title", "description"};
    if (key == "required") {
      for (const Json& name : rule)
        if (value.is_object() && !value.contains(name.get<std::string>()))
          out.push_back(path + ": lacks " + name.dump());
    } else if (key == "properties") {
      if (!value.is_object()) return;
      for (const auto& [name, inner] : rule.items())
        if (value.contains(name)) check(inner, value[name], path + "/" + name, out);
    } else if (key == "additionalProperties" && rule == false) {
      if (!value.is_object()) return;
      for (const auto& item : value.items())
        if (!schema["properties"].contains(item.key()))
          out.push_back(path + ": has an unknown key '" + item.key() + "'");
    } else if (key == "items") {
      if (!value.is_array()) return;
      for (std::size_t i = 0; i < value.size(); ++i)
        check(rule, value[i], path + "/" + std::to_string(i), out);
    } else if (key == "minItems") {
      if (value.is_array() && value.size() < rule.get<std::size_t>())
        out.push_back(path + ": fewer than " + rule.dump() + " items");
    } else if (!silent.contains(key)) {
      throw std::runtime_error("schema: unknown keyword " + key);
    }
  }

  Json root_;
};

}  // namespace varve::test
