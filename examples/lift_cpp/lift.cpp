// The lift under test. It speaks the component protocol (docs/programs.md) with the standard library alone.
// Build it with: g++ -O1 -std=c++17 -o lift lift.cpp

#include <cctype>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

// ---- JSON: enough to read any value and to write what a lift says ----

struct Json {
    enum Kind { null, boolean, number, text, list, object } kind = null;
    bool truth = false;
    double value = 0;
    std::string words;
    std::vector<Json> items;
    std::map<std::string, Json> fields;

    const Json& operator[](const std::string& name) const {
        auto found = fields.find(name);
        if (found == fields.end()) throw std::runtime_error("there is no field " + name);
        return found->second;
    }
};

class Reader {
  public:
    explicit Reader(const std::string& line) : at(line.c_str()) {}

    Json read() {
        Json made;
        switch (next()) {
            case '{':
                made.kind = Json::object;
                for (++at; next() != '}'; skip(',')) {
                    std::string name = text();
                    require(':');
                    made.fields[name] = read();
                }
                ++at;
                break;
            case '[':
                made.kind = Json::list;
                for (++at; next() != ']'; skip(',')) made.items.push_back(read());
                ++at;
                break;
            case '"':
                made.kind = Json::text;
                made.words = text();
                break;
            case 't': made.kind = Json::boolean; made.truth = true; word("true"); break;
            case 'f': made.kind = Json::boolean; word("false"); break;
            case 'n': word("null"); break;
            default: {
                made.kind = Json::number;
                char* end;
                made.value = std::strtod(at, &end);
                if (end == at) throw std::runtime_error(std::string("no JSON value: ") + at);
                at = end;
            }
        }
        return made;
    }

  private:
    const char* at;

    char next() {
        while (*at == ' ' || *at == '\t') ++at;
        return *at;
    }
    void skip(char sign) {
        if (next() == sign) ++at;
    }
    void require(char sign) {
        if (next() != sign) throw std::runtime_error(std::string("expected ") + sign + " at " + at);
        ++at;
    }
    void word(const std::string& wanted) {
        if (std::string(at).compare(0, wanted.size(), wanted) != 0) throw std::runtime_error("no JSON value");
        at += wanted.size();
    }
    std::string text() {
        std::string made;
        require('"');
        while (*at != '"') {
            if (*at == '\0') throw std::runtime_error("a text does not end");
            if (*at != '\\') {
                made += *at++;
                continue;
            }
            char sign = *++at;
            if (sign == '\0') throw std::runtime_error("a text does not end");
            ++at;
            if (sign == 'u') {
                made += utf8();
            } else {
                static const std::map<char, char> signs = {{'n', '\n'}, {'t', '\t'}, {'r', '\r'}, {'b', '\b'}, {'f', '\f'}};
                made += signs.count(sign) ? signs.at(sign) : sign;
            }
        }
        ++at;
        return made;
    }
    unsigned four() {  // the digits after \u
        unsigned code = 0;
        for (int k = 0; k < 4; ++k, ++at) {
            if (!std::isxdigit(static_cast<unsigned char>(*at))) throw std::runtime_error("\\u needs four digits");
            code = 16 * code + std::stoi(std::string(1, *at), nullptr, 16);
        }
        return code;
    }
    std::string utf8() {
        unsigned code = four();
        if (code >= 0xD800 && code < 0xDC00 && at[0] == '\\' && at[1] == 'u') {  // the rest of a surrogate pair
            at += 2;
            code = 0x10000 + ((code - 0xD800) << 10) + (four() - 0xDC00);
        }
        std::string made;
        auto rest = [&](int shift) { made += static_cast<char>(0x80 | ((code >> shift) & 0x3F)); };
        if (code < 0x80) {
            made += static_cast<char>(code);
        } else if (code < 0x800) {
            made += static_cast<char>(0xC0 | (code >> 6)), rest(0);
        } else if (code < 0x10000) {
            made += static_cast<char>(0xE0 | (code >> 12)), rest(6), rest(0);
        } else {
            made += static_cast<char>(0xF0 | (code >> 18)), rest(12), rest(6), rest(0);
        }
        return made;
    }
};

std::string floor_message(int floor) { return "{\"floor\":" + std::to_string(floor) + "}"; }
std::string order(double hold) { return "{\"hold\":" + std::to_string(hold) + "}"; }
std::string door_state(bool shut) { return std::string("{\"shut\":") + (shut ? "true" : "false") + "}"; }

// ---- The lift. A step is the transition taken, and the messages sent with it as JSON; empty if there is nothing to do. ----

struct Step {
    std::string transition;
    std::vector<std::pair<std::string, std::string>> sent;
};

struct Component {
    virtual ~Component() = default;
    virtual Step take_up(const std::string& channel, const Json& message) = 0;
    virtual Step asked(const std::string&) { return {}; }
    virtual void input(const std::string&, const Json&) {}
};

struct Panel : Component {
    Step take_up(const std::string& channel, const Json& message) override {
        std::string same = floor_message(static_cast<int>(message["floor"].value));
        if (channel == "call") return {"p1", {{"request", same}}};
        if (channel == "arrived") return {"p2", {{"lamp", same}}};
        return {};
    }
};

struct Cabin : Component {
    int floor = 0, target = 0;

    Step take_up(const std::string& channel, const Json& message) override {
        if (channel == "request") {
            int wanted = static_cast<int>(message["floor"].value);
            if (wanted == floor) return {"c4", {{"arrived", floor_message(floor)}}};
            target = wanted;
            return {"c1", {{"close", order(0.5)}}};
        }
        if (channel == "door") {
            if (!message["shut"].truth) return {"c3", {{"close", order(2.0)}}};
            floor = target;
            return {"c2", {{"arrived", floor_message(floor)}}};
        }
        return {};
    }
};

struct Door : Component {
    bool blocked = false;

    Step take_up(const std::string& channel, const Json&) override {
        if (channel != "close") return {};
        return blocked ? Step{"d1", {{"door", door_state(false)}}} : Step{"d2", {{"door", door_state(true)}}};
    }
    Step asked(const std::string& transition) override {
        return transition == "d3" ? Step{"d3", {}} : Step{};  // no message starts it
    }
    void input(const std::string& name, const Json& value) override {
        if (name == "blocked") blocked = value.truth;
    }
};

std::unique_ptr<Component> made(const std::string& name) {
    if (name == "Panel") return std::make_unique<Panel>();
    if (name == "Cabin") return std::make_unique<Cabin>();
    if (name == "Door") return std::make_unique<Door>();
    throw std::runtime_error("no component is called " + name);
}

// ---- The protocol: read a line, do what it says, answer if that is wanted. ----

int main(int count, char** arguments) {
    try {
        const std::string name = count > 1 ? arguments[1] : "";
        std::unique_ptr<Component> component = made(name);
        std::function<Step()> begin;  // what the next permit lets happen
        std::string line;
        while (std::getline(std::cin, line)) {
            const Json said = Reader(line).read();
            if (said.fields.empty()) throw std::runtime_error("no word: " + line);
            const std::string word = said.fields.begin()->first;
            const Json& content = said.fields.begin()->second;
            if (word == "hello") {
                std::cout << "{\"hello\":{\"component\":\"" << name << "\"}}" << std::endl;
            } else if (word == "reset") {
                component = made(name);
                begin = nullptr;
                std::cout << "{\"reset\":true}" << std::endl;
            } else if (word == "inputs") {
                for (const auto& [input, value] : content.fields) component->input(input, value);
            } else if (word == "deliver") {
                begin = [&component, content] { return component->take_up(content["channel"].words, content["message"]); };
            } else if (word == "ask") {
                begin = [&component, content] { return component->asked(content["transition"].words); };
            } else if (word == "permit") {
                Step step = begin ? begin() : Step{};
                begin = nullptr;
                for (const auto& [channel, message] : step.sent) {
                    std::cout << "{\"sent\":{\"channel\":\"" << channel << "\",\"message\":" << message << "}}\n";
                }
                std::string taken = step.transition.empty() ? "null" : '"' + step.transition + '"';
                std::cout << "{\"took\":" << taken << "}" << std::endl;
            }
        }
    } catch (const std::exception& error) {
        std::cerr << error.what() << std::endl;
        return 1;
    }
}
