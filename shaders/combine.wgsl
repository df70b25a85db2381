// combine
