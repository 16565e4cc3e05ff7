/** Parser for server-sent events. */

/**
 * Read the data of each event of a stream.
 *
 * @param {ReadableStream<BufferSource>} stream
 * @returns {AsyncGenerator<string>}
 */
export async function* readEvents(stream) {
  const reader = stream.pipeThrough(new TextDecoderStream()).getReader();
  let unread = "";
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) {
        return;
      }
      const blocks = (unread + value).split(/\r?\n\r?\n/);
      unread = blocks.pop() ?? "";
      for (const block of blocks) {
        const data = dataOf(block);
        if (data) {
          yield data;
        }
      }
    }
  } finally {
    await reader.cancel().catch(() => undefined); // an aborted stream cannot be canceled
  }
}

/**
 * @param {string} block - The lines of one event, or of a comment that keeps the connection open.
 * @returns {string} Empty for a comment.
 */
function dataOf(block) {
  return block
    .split(/\r?\n/)
    .filter((line) => line.startsWith("data:"))
    .map((line) => line.slice("data:".length).trimStart())
    .join("\n");
}
