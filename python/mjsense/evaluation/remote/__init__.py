# SPDX-License-Identifier: Apache-2.0
"""Policies in another process or on another computer, by openpi's protocol: messages of MessagePack over a websocket.

The server's first message is a map of metadata. Then each message of the client is an observation, and its answer a map with
``actions`` ``[H, n]``. A message of text is an error of the server.
"""
