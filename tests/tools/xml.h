// Whether a text is XML as far as our own writers use it.
#pragma once

#include <set>
#include <string>
#include <vector>

namespace varve::test {

/// Empty if every element that opens closes in order, and no stray '<' or '&' stands in the text.
inline std::string broken_xml(const std::string& text) {
  std::vector<std::string> open;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '&') {
      const std::size_t end = text.find(';', i);
      const std::string entity = text.substr(i + 1, end - i - 1);
      const std::set<std::string> known{"amp", "lt", "gt", "quot"};
      if (known.count(entity) == 0) return "entity " + entity;
    }
    if (text[i] != '<') continue;
    const std::size_t end = text.find('>', i);
    if (end == std::string::npos) return "an element does not end";
    const std::string element = text.substr(i + 1, end - i - 1);
    if (element.find('<') != std::string::npos) return "stray <";
    const std::string name = element.substr(0, element.find_first_of(" /", 1));
    if (element.front() == '/') {
      if (open.empty() || "/" + open.back() != element) return "closes " + element;
      open.pop_back();
    } else if (element.back() != '/') {
      open.push_back(name);
    }
    i = end;
  }
  return open.empty() ? "" : "open: " + open.back();
}

}  // namespace varve::test
