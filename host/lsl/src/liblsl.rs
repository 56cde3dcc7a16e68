//! The C interface of liblsl. This file contains all of the crate's calls of liblsl.
//!
//! Source of the declarations: the headers `lsl/common.h`, `streaminfo.h`, `xml.h`, `outlet.h`,
//! `inlet.h` and `resolver.h` of liblsl 1.13 to 1.18. Outlets, descriptions and inlets are handles,
//! which their owners in this file destroy. None of the owners is `Send`: each stays in its thread.
#![expect(unsafe_code, reason = "liblsl is a C library, which is loaded when it is needed")]

use std::ffi::{CStr, CString, OsStr, c_char, c_double, c_float, c_int, c_ulong, c_void};
use std::ptr::{self, NonNull};

use thiserror::Error;

/// Format of a stream of 32-bit floats (`cft_float32`).
pub(crate) const FLOAT: c_int = 1;
/// Format of a stream of strings (`cft_string`).
pub(crate) const STRING: c_int = 3;
/// Length of the buffer in which liblsl keeps samples for a slow receiver, seconds; liblsl's
/// default.
const BUFFER_S: i32 = 360;
/// Largest number of streams that one search returns.
const MOST_FOUND: u32 = 64;

/// Why the library cannot be loaded.
#[derive(Debug, Error)]
pub enum LoadError {
    /// The system's loader refuses the file.
    #[error(transparent)]
    Open(libloading::Error),
    /// The library lacks a function, which the first field names.
    #[error("it has no function {0}")]
    Function(&'static str, #[source] libloading::Error),
}

#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub(crate) enum CallError {
    /// The stream has ended and does not return.
    #[error("the stream has ended")]
    Lost,
    /// Nothing arrived within the timeout.
    #[error("no answer in time")]
    Timeout,
    /// Another error, in liblsl's words.
    #[error("{0}")]
    Other(String),
}

/// Declares the table of liblsl's functions, with their types, and the function that loads it.
macro_rules! functions {
    ($($name:ident: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// Addresses of the functions of liblsl. The library stays loaded until the process ends,
        /// because liblsl may leave threads behind.
        #[derive(Debug)]
        pub(crate) struct Functions {
            $($name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            /// Loads the library `file`, which is a path or a name that the system's loader finds.
            pub(crate) fn load(file: &OsStr) -> Result<&'static Functions, LoadError> {
                // SAFETY: the initialisers of liblsl have no preconditions; a user who names
                // another library runs that one's.
                let library = unsafe { libloading::Library::new(file) }.map_err(LoadError::Open)?;
                let library: &'static libloading::Library = Box::leak(Box::new(library));
                Ok(Box::leak(Box::new(Functions {
                    $($name: {
                        let name = stringify!($name);
                        // SAFETY: the type is that of the function's declaration in the headers.
                        let symbol = unsafe { library.get(name) };
                        *symbol.map_err(|error| LoadError::Function(name, error))?
                    },)*
                })))
            }
        }
    };
}

functions! {
    lsl_library_version: fn() -> i32;
    lsl_library_info: fn() -> *const c_char;
    lsl_last_error: fn() -> *const c_char;
    lsl_local_clock: fn() -> c_double;
    lsl_create_streaminfo: fn(*const c_char, *const c_char, i32, c_double, c_int, *const c_char) -> *mut c_void;
    lsl_destroy_streaminfo: fn(*mut c_void);
    lsl_get_name: fn(*mut c_void) -> *const c_char;
    lsl_get_type: fn(*mut c_void) -> *const c_char;
    lsl_get_source_id: fn(*mut c_void) -> *const c_char;
    lsl_get_hostname: fn(*mut c_void) -> *const c_char;
    lsl_get_channel_count: fn(*mut c_void) -> i32;
    lsl_get_channel_format: fn(*mut c_void) -> c_int;
    lsl_get_nominal_srate: fn(*mut c_void) -> c_double;
    lsl_get_desc: fn(*mut c_void) -> *mut c_void;
    lsl_child: fn(*mut c_void, *const c_char) -> *mut c_void;
    lsl_next_sibling_n: fn(*mut c_void, *const c_char) -> *mut c_void;
    lsl_empty: fn(*mut c_void) -> i32;
    lsl_child_value_n: fn(*mut c_void, *const c_char) -> *const c_char;
    lsl_append_child: fn(*mut c_void, *const c_char) -> *mut c_void;
    lsl_append_child_value: fn(*mut c_void, *const c_char, *const c_char) -> *mut c_void;
    lsl_create_outlet: fn(*mut c_void, i32, i32) -> *mut c_void;
    lsl_destroy_outlet: fn(*mut c_void);
    lsl_push_chunk_ftnp: fn(*mut c_void, *const c_float, c_ulong, *const c_double, i32) -> i32;
    lsl_push_sample_strtp: fn(*mut c_void, *const *const c_char, c_double, i32) -> i32;
    lsl_have_consumers: fn(*mut c_void) -> i32;
    lsl_resolve_bypred: fn(*mut *mut c_void, u32, *const c_char, i32, c_double) -> i32;
    lsl_create_inlet: fn(*mut c_void, i32, i32, i32) -> *mut c_void;
    lsl_destroy_inlet: fn(*mut c_void);
    lsl_get_fullinfo: fn(*mut c_void, c_double, *mut i32) -> *mut c_void;
    lsl_time_correction: fn(*mut c_void, c_double, *mut i32) -> c_double;
    lsl_pull_chunk_f: fn(*mut c_void, *mut c_float, *mut c_double, c_ulong, c_ulong, c_double, *mut i32) -> c_ulong;
}

/// Returns the text without NUL characters, which end a C string.
fn c_string(text: &str) -> CString {
    CString::new(text.replace('\0', "")).unwrap_or_default()
}

/// Copies a C string. A null pointer yields an empty string.
///
/// # Safety
/// `text` is null, or a C string that lives at least as long as this call.
unsafe fn copied(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null; the rest is this function's own precondition.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_string_lossy().into_owned()
}

impl Functions {
    /// Returns 100 times the major version, plus the minor version.
    pub(crate) fn library_version(&self) -> i32 {
        // SAFETY: no preconditions.
        unsafe { (self.lsl_library_version)() }
    }

    /// Returns the library's description of itself.
    pub(crate) fn library_info(&self) -> String {
        // SAFETY: no preconditions.
        let info = unsafe { (self.lsl_library_info)() };
        // SAFETY: a constant of the library.
        unsafe { copied(info) }
    }

    /// Returns the time of liblsl's clock, seconds.
    pub(crate) fn local_clock(&self) -> f64 {
        // SAFETY: no preconditions; the library is initialised when it is loaded.
        unsafe { (self.lsl_local_clock)() }
    }

    fn last_error(&self) -> CallError {
        // SAFETY: no preconditions.
        let text = unsafe { (self.lsl_last_error)() };
        // SAFETY: a buffer of this thread, which only the next call of liblsl changes.
        let text = unsafe { copied(text) };
        CallError::Other(if text.is_empty() {
            "liblsl reports an error without a text".to_owned()
        } else {
            text
        })
    }

    fn checked(&self, code: i32) -> Result<(), CallError> {
        match code {
            0.. => Ok(()),
            -1 => Err(CallError::Timeout),
            -2 => Err(CallError::Lost),
            _ => Err(self.last_error()),
        }
    }

    /// Searches the network for streams that match the XPath predicate `query`, such as `name='X'`.
    /// Returns as soon as two are found, or after `timeout_s` seconds.
    pub(crate) fn resolve(
        &'static self,
        query: &str,
        timeout_s: f64,
    ) -> Result<Vec<Info>, CallError> {
        let query = c_string(query);
        let mut handles = [ptr::null_mut::<c_void>(); MOST_FOUND as usize];
        let buffer = handles.as_mut_ptr();
        let query = query.as_ptr();
        // Ask for 2: liblsl ends the search at this number, and a second stream may answer later.
        // SAFETY: the buffer has room for as many handles as stated, and the query is a C string.
        let found = unsafe { (self.lsl_resolve_bypred)(buffer, MOST_FOUND, query, 2, timeout_s) };
        self.checked(found)?;
        let found = handles.into_iter().filter_map(NonNull::new);
        Ok(found.map(|handle| Info { functions: self, handle }).collect())
    }
}

/// Description of a stream.
#[derive(Debug)]
pub(crate) struct Info {
    functions: &'static Functions,
    handle: NonNull<c_void>,
}

impl Drop for Info {
    fn drop(&mut self) {
        // SAFETY: the handle is valid, and this is its only owner.
        unsafe { (self.functions.lsl_destroy_streaminfo)(self.handle.as_ptr()) }
    }
}

/// Properties that every stream must have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StreamHead<'a> {
    pub(crate) name: &'a str,
    pub(crate) content: &'a str,
    pub(crate) channels: i32,
    /// Nominal rate, Hz; 0 for samples at irregular times.
    pub(crate) rate_hz: f64,
    /// [`FLOAT`] or [`STRING`].
    pub(crate) format: c_int,
    pub(crate) source_id: &'a str,
}

impl Info {
    pub(crate) fn new(
        functions: &'static Functions,
        head: &StreamHead<'_>,
    ) -> Result<Info, CallError> {
        let [name, content, source] = [head.name, head.content, head.source_id].map(c_string);
        // SAFETY: three C strings that outlive the call, which copies them.
        let handle = unsafe {
            (functions.lsl_create_streaminfo)(
                name.as_ptr(),
                content.as_ptr(),
                head.channels,
                head.rate_hz,
                head.format,
                source.as_ptr(),
            )
        };
        let handle = NonNull::new(handle).ok_or_else(|| functions.last_error())?;
        Ok(Info { functions, handle })
    }

    /// Returns the element `desc`, which holds all further metadata.
    pub(crate) fn desc(&self) -> Element<'_> {
        // SAFETY: the handle is valid. The element is a part of it, and borrows it.
        let element = unsafe { (self.functions.lsl_get_desc)(self.handle.as_ptr()) };
        Element { info: self, element }
    }

    pub(crate) fn name(&self) -> String {
        // SAFETY: the handle is valid.
        let text = unsafe { (self.functions.lsl_get_name)(self.handle.as_ptr()) };
        // SAFETY: a part of the description, which lives on.
        unsafe { copied(text) }
    }

    pub(crate) fn content(&self) -> String {
        // SAFETY: the handle is valid.
        let text = unsafe { (self.functions.lsl_get_type)(self.handle.as_ptr()) };
        // SAFETY: a part of the description, which lives on.
        unsafe { copied(text) }
    }

    pub(crate) fn source_id(&self) -> String {
        // SAFETY: the handle is valid.
        let text = unsafe { (self.functions.lsl_get_source_id)(self.handle.as_ptr()) };
        // SAFETY: a part of the description, which lives on.
        unsafe { copied(text) }
    }

    pub(crate) fn host(&self) -> String {
        // SAFETY: the handle is valid.
        let text = unsafe { (self.functions.lsl_get_hostname)(self.handle.as_ptr()) };
        // SAFETY: a part of the description, which lives on.
        unsafe { copied(text) }
    }

    pub(crate) fn channels(&self) -> i32 {
        // SAFETY: the handle is valid.
        unsafe { (self.functions.lsl_get_channel_count)(self.handle.as_ptr()) }
    }

    /// Returns whether the samples are strings.
    pub(crate) fn is_text(&self) -> bool {
        // SAFETY: the handle is valid.
        let format = unsafe { (self.functions.lsl_get_channel_format)(self.handle.as_ptr()) };
        format == STRING
    }

    /// Returns the nominal rate, Hz; 0 for samples at irregular times.
    pub(crate) fn rate_hz(&self) -> f64 {
        // SAFETY: the handle is valid.
        unsafe { (self.functions.lsl_get_nominal_srate)(self.handle.as_ptr()) }
    }
}

/// An element of a stream's description; a null element has no content and no children.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element<'i> {
    info: &'i Info,
    element: *mut c_void,
}

impl<'i> Element<'i> {
    fn with(self, element: *mut c_void) -> Element<'i> {
        let info = self.info;
        Element { info, element }
    }

    /// Appends a child without text and returns it.
    pub(crate) fn append(self, name: &str) -> Element<'i> {
        let name = c_string(name);
        let append = self.info.functions.lsl_append_child;
        // SAFETY: an element of a description that lives on, and a C string, which is copied.
        let child = unsafe { append(self.element, name.as_ptr()) };
        self.with(child)
    }

    /// Appends a child with a text.
    pub(crate) fn append_text(self, name: &str, text: &str) {
        let [name, text] = [name, text].map(c_string);
        let append = self.info.functions.lsl_append_child_value;
        // SAFETY: an element of a description that lives on, and C strings, which are copied.
        unsafe { append(self.element, name.as_ptr(), text.as_ptr()) };
    }

    /// Returns the first child of this name.
    pub(crate) fn child(self, name: &str) -> Element<'i> {
        let name = c_string(name);
        let child = self.info.functions.lsl_child;
        // SAFETY: an element of a description that lives on, or null, and a C string.
        let child = unsafe { child(self.element, name.as_ptr()) };
        self.with(child)
    }

    /// Returns the text of the first child of this name; empty without one.
    pub(crate) fn text(self, name: &str) -> String {
        let name = c_string(name);
        let value = self.info.functions.lsl_child_value_n;
        // SAFETY: an element of a description that lives on, or null, and a C string.
        let text = unsafe { value(self.element, name.as_ptr()) };
        // SAFETY: a part of the description, or a constant.
        unsafe { copied(text) }
    }

    /// Returns all children of this name.
    pub(crate) fn children(self, name: &str) -> impl Iterator<Item = Element<'i>> {
        let c_name = c_string(name);
        let next = move |element: &Element<'i>| {
            let next = element.info.functions.lsl_next_sibling_n;
            // SAFETY: an element of a description that lives on, and a C string.
            let sibling = unsafe { next(element.element, c_name.as_ptr()) };
            element.with(sibling).existing()
        };
        std::iter::successors(self.child(name).existing(), next)
    }

    fn existing(self) -> Option<Element<'i>> {
        let is_empty = self.info.functions.lsl_empty;
        // SAFETY: an element of a description that lives on, or null.
        let is_empty = unsafe { is_empty(self.element) };
        (is_empty == 0).then_some(self)
    }
}

/// A stream that others can subscribe to, until this value is dropped.
#[derive(Debug)]
pub(crate) struct Outlet {
    functions: &'static Functions,
    handle: NonNull<c_void>,
    channels: usize,
}

impl Drop for Outlet {
    fn drop(&mut self) {
        // SAFETY: the handle is valid, and this is its only owner.
        unsafe { (self.functions.lsl_destroy_outlet)(self.handle.as_ptr()) }
    }
}

impl Outlet {
    pub(crate) fn new(info: &Info) -> Result<Outlet, CallError> {
        let functions = info.functions;
        let channels = usize::try_from(info.channels()).unwrap_or(0);
        let create = functions.lsl_create_outlet;
        // SAFETY: a valid description, which is copied.
        let handle = unsafe { create(info.handle.as_ptr(), 0, BUFFER_S) };
        let handle = NonNull::new(handle).ok_or_else(|| functions.last_error())?;
        Ok(Outlet { functions, handle, channels })
    }

    /// Sends samples, one after the other in `values`, each with its time in seconds.
    ///
    /// # Panics
    /// If there is not exactly one value for each time and channel.
    pub(crate) fn push(&self, values: &[f32], times_s: &[f64]) -> Result<(), CallError> {
        assert_eq!(values.len(), times_s.len() * self.channels, "values");
        let (handle, count) = (self.handle.as_ptr(), values.len() as c_ulong);
        let push = self.functions.lsl_push_chunk_ftnp;
        // SAFETY: as many values as stated, and as many times as that makes samples of the
        // stream's channels; both are copied.
        let code = unsafe { push(handle, values.as_ptr(), count, times_s.as_ptr(), 1) };
        self.functions.checked(code)
    }

    /// Sends a text on a stream of strings with one channel.
    ///
    /// # Panics
    /// If the stream has another number of channels.
    pub(crate) fn push_text(&self, text: &str, time_s: f64) -> Result<(), CallError> {
        assert_eq!(self.channels, 1, "channels");
        let text = c_string(text);
        let values = [text.as_ptr()];
        let push = self.functions.lsl_push_sample_strtp;
        // SAFETY: one C string for the one channel; it is copied.
        let code = unsafe { push(self.handle.as_ptr(), values.as_ptr(), time_s, 1) };
        self.functions.checked(code)
    }

    /// Returns whether anyone receives the stream.
    pub(crate) fn has_receivers(&self) -> bool {
        // SAFETY: the handle is valid.
        unsafe { (self.functions.lsl_have_consumers)(self.handle.as_ptr()) != 0 }
    }
}

/// A subscription to a stream. liblsl reconnects if the stream returns with the same source id.
#[derive(Debug)]
pub(crate) struct Inlet {
    functions: &'static Functions,
    handle: NonNull<c_void>,
    channels: usize,
}

impl Drop for Inlet {
    fn drop(&mut self) {
        // SAFETY: the handle is valid, and this is its only owner.
        unsafe { (self.functions.lsl_destroy_inlet)(self.handle.as_ptr()) }
    }
}

impl Inlet {
    pub(crate) fn new(info: &Info) -> Result<Inlet, CallError> {
        let functions = info.functions;
        let channels = usize::try_from(info.channels()).unwrap_or(0);
        let create = functions.lsl_create_inlet;
        // SAFETY: a valid description, which is copied.
        let handle = unsafe { create(info.handle.as_ptr(), BUFFER_S, 0, 1) };
        let handle = NonNull::new(handle).ok_or_else(|| functions.last_error())?;
        Ok(Inlet { functions, handle, channels })
    }

    /// Returns the description including the element `desc`, which searches do not return.
    pub(crate) fn info(&self, timeout_s: f64) -> Result<Info, CallError> {
        let mut code = 0;
        let get = self.functions.lsl_get_fullinfo;
        // SAFETY: the handle is valid, and the code outlives the call.
        let handle = unsafe { get(self.handle.as_ptr(), timeout_s, &raw mut code) };
        self.functions.checked(code)?;
        let handle = NonNull::new(handle).ok_or_else(|| self.functions.last_error())?;
        let functions = self.functions;
        Ok(Info { functions, handle })
    }

    /// Returns the offset, seconds, that converts the stream's times to this machine's LSL clock.
    pub(crate) fn time_correction(&self, timeout_s: f64) -> Result<f64, CallError> {
        let mut code = 0;
        let get = self.functions.lsl_time_correction;
        // SAFETY: the handle is valid, and the code outlives the call.
        let correction = unsafe { get(self.handle.as_ptr(), timeout_s, &raw mut code) };
        self.functions.checked(code)?;
        Ok(correction)
    }

    /// Waits for samples, for `timeout_s` seconds at most, and fills the start of both buffers.
    /// Returns the number of samples.
    pub(crate) fn pull(
        &self,
        values: &mut [f32],
        times_s: &mut [f64],
        timeout_s: f64,
    ) -> Result<usize, CallError> {
        let samples = times_s.len().min(values.len() / self.channels.max(1));
        let (most_values, most_times) = (samples * self.channels, samples);
        let (buffer, times) = (values.as_mut_ptr(), times_s.as_mut_ptr());
        let mut code = 0;
        let pull = self.functions.lsl_pull_chunk_f;
        // SAFETY: the buffers have at least as much room as stated, and the code outlives the call.
        let pulled = unsafe {
            pull(
                self.handle.as_ptr(),
                buffer,
                times,
                most_values as c_ulong,
                most_times as c_ulong,
                timeout_s,
                &raw mut code,
            )
        };
        self.functions.checked(code)?;
        Ok(usize::try_from(pulled).unwrap_or(0) / self.channels.max(1))
    }
}
