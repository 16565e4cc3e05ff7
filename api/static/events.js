/** The text of server-sent events. */

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
    await reader.cancel().catch(() => undefined); // a stream that was aborted has nothing left to cancel
  }
}

/**
 * @param {string} block - The lines of one event; comments, which keep a connection open, have no data.
 * @returns {string}
 */
function dataOf(block) {
  return block
    .split(/\r?\n/)
    .filter((line) => line.startsWith("data:"))
    .map((line) => line.slice("data:".length).trimStart())
    .join("\n");
}
