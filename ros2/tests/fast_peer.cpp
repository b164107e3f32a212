// A peer on Fast DDS, the DDS under rmw_fastrtps, with Fast CDR as its encoder: nothing of it is shared with ours.
//
//   fast_peer DOMAIN TOPIC TYPE LAYOUT sub COUNT          prints each message as a line of its numbers and texts
//   fast_peer DOMAIN TOPIC TYPE LAYOUT pub reliable|best  publishes a message for each such line of its input
//
// LAYOUT: b uint8, i int32, u uint32, f float32, d float64, s string, [..] a sequence of what is inside. On a line the
// length of a sequence stands before it, and each text behind a colon.
#include <fastcdr/Cdr.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

#include <chrono>
#include <cstdio>
#include <iostream>
#include <sstream>
#include <string>
#include <thread>

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;
using namespace std::chrono_literals;

constexpr size_t LARGEST = 65536;

size_t closing(const std::string& layout, size_t open) {
  for (int depth = 0;; ++open) {
    depth += layout.at(open) == '[';
    depth -= layout.at(open) == ']';
    if (depth == 0) return open;
  }
}

template <class T> void encode_number(std::istream& line, Cdr& cdr) {
  std::string word;
  line >> word;
  cdr << static_cast<T>(std::stod(word));  // nan and inf too
}

template <class T> void decode_number(Cdr& cdr, std::ostream& line) {
  T number;
  cdr >> number;
  line << +number << ' ';
}

void encode(const std::string& layout, std::istream& line, Cdr& cdr) {
  for (size_t i = 0; i < layout.size(); ++i) {
    std::string word;
    switch (layout[i]) {
      case 'b': encode_number<uint8_t>(line, cdr); break;
      case 'i': encode_number<int32_t>(line, cdr); break;
      case 'u': encode_number<uint32_t>(line, cdr); break;
      case 'f': encode_number<float>(line, cdr); break;
      case 'd': encode_number<double>(line, cdr); break;
      case 's': line >> word; cdr << word.substr(1); break;
      case '[': {
        uint32_t count;
        line >> count;
        cdr << count;
        const size_t end = closing(layout, i);
        for (; count; --count) encode(layout.substr(i + 1, end - i - 1), line, cdr);
        i = end;
      }
    }
  }
}

void decode(const std::string& layout, Cdr& cdr, std::ostream& line) {
  for (size_t i = 0; i < layout.size(); ++i) {
    std::string word;
    switch (layout[i]) {
      case 'b': decode_number<uint8_t>(cdr, line); break;
      case 'i': decode_number<int32_t>(cdr, line); break;
      case 'u': decode_number<uint32_t>(cdr, line); break;
      case 'f': decode_number<float>(cdr, line); break;
      case 'd': decode_number<double>(cdr, line); break;
      case 's': cdr >> word; line << ':' << word << ' '; break;
      case '[': {
        uint32_t count;
        cdr >> count;
        line << count << ' ';
        const size_t end = closing(layout, i);
        for (; count; --count) decode(layout.substr(i + 1, end - i - 1), cdr, line);
        i = end;
      }
    }
  }
}

// A message is a line of text, encoded and decoded by the layout.
struct Type : fast::TopicDataType {
  std::string layout;
  Type(const char* name, const char* given) : layout(given) {
    setName(name);
    m_typeSize = LARGEST;
    m_isGetKeyDefined = false;
  }
  bool serialize(void* text, rtps::SerializedPayload_t* payload) override {
    FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->max_size);
    Cdr cdr(buffer, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
    payload->encapsulation = CDR_LE;
    cdr.serialize_encapsulation();
    std::istringstream line(*static_cast<std::string*>(text));
    encode(layout, line, cdr);
    payload->length = static_cast<uint32_t>(cdr.getSerializedDataLength());
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* text) override {
    FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
    Cdr cdr(buffer, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
    cdr.read_encapsulation();
    std::ostringstream line;
    line.precision(17);
    decode(layout, cdr, line);
    *static_cast<std::string*>(text) = line.str();
    return true;
  }
  std::function<uint32_t()> getSerializedSizeProvider(void*) override { return [] { return uint32_t(LARGEST); }; }
  void* createData() override { return new std::string; }
  void deleteData(void* text) override { delete static_cast<std::string*>(text); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

fast::DomainParticipant* participant(int domain) {
  fast::DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  loopback->interfaceWhiteList.push_back("127.0.0.1");
  qos.transport().user_transports.push_back(loopback);
  rtps::Locator_t here;
  rtps::IPLocator::setIPv4(here, "127.0.0.1");
  qos.wire_protocol().builtin.initialPeersList.push_back(here);
  return fast::DomainParticipantFactory::get_instance()->create_participant(domain, qos);
}

int subscribe(fast::DomainParticipant* node, fast::Topic* topic, int count) {
  fast::DataReaderQos qos;
  qos.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
  qos.history().depth = 10;
  auto reader = node->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT)->create_datareader(topic, qos);
  const auto end = std::chrono::steady_clock::now() + 20s;
  while (count > 0 && std::chrono::steady_clock::now() < end) {
    reader->wait_for_unread_message({0, 100000000});
    std::string line;
    fast::SampleInfo info;
    while (count > 0 && reader->take_next_sample(&line, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      std::cout << line << std::endl;
      --count;
    }
  }
  return count;
}

int publish(fast::DomainParticipant* node, fast::Topic* topic, bool reliable) {
  fast::DataWriterQos qos;
  qos.reliability().kind = reliable ? fast::RELIABLE_RELIABILITY_QOS : fast::BEST_EFFORT_RELIABILITY_QOS;
  qos.history().depth = 10;
  qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  auto writer = node->create_publisher(fast::PUBLISHER_QOS_DEFAULT)->create_datawriter(topic, qos);
  fast::PublicationMatchedStatus matched;
  for (int i = 0; i < 1000 && matched.current_count == 0; ++i) {
    std::this_thread::sleep_for(20ms);
    writer->get_publication_matched_status(matched);
  }
  std::this_thread::sleep_for(200ms);  // until the other side has matched too
  for (std::string line; std::getline(std::cin, line);) {
    writer->write(&line);
    std::this_thread::sleep_for(5ms);
  }
  std::this_thread::sleep_for(500ms);
  return matched.current_count == 0;
}

int main(int, char** given) {
  auto node = participant(std::stoi(given[1]));
  fast::TypeSupport type(new Type(given[3], given[4]));
  type.register_type(node);
  auto topic = node->create_topic(given[2], given[3], fast::TOPIC_QOS_DEFAULT);
  if (std::string(given[5]) == "sub") return subscribe(node, topic, std::stoi(given[6]));
  return publish(node, topic, std::string(given[6]) == "reliable");
}
