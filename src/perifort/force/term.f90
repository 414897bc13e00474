!> Terms of the force: what acts on the points beside their bonds. Loads are terms, and so is
!> whatever a program adds that uses the library: springs to the ground, dashpots, contact, gravity
!> between bodies.
!>
!> A term extends `force_term_type` and says what force density it adds, what energy it stores, how
!> stiff it is at most, what it has to keep for a restart, and what it is, in a line. It sees the
!> body through a `term_view_type`. That is all: the loops over time, the time step, the energy
!> balance, checkpoints and the solvers of static equilibrium work on the list of terms alone.
!>
!> The same bits on any number of threads: a term that computes in parallel lets each slot sum what
!> is its own, in a fixed order.
module pd_force_term
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  use pd_base_reduce, only: inner
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_law_material, only: material_type
  use pd_family_family, only: family_type
  use pd_force_obstacle, only: obstacle_type
  implicit none (type, external)
  private
  public :: force_term_type, term_list_type, term_view_type, density_of
  public :: no_tangent, has_tangent, no_stiffness

  !> How the force of a term depends on displacements: somehow, and the term can't say how; with the
  !> tangent that `add_tangent` gives; not at all, as a load that depends on time alone, or a
  !> dashpot. Static equilibrium is not computed with terms of the first kind.
  integer, parameter :: no_tangent = 0, has_tangent = 1, no_stiffness = 2

  !> What a term sees. Nothing of it is the term's to change. Arrays are over slots; dead slots
  !> (`body%point` is 0) have no volume and stay zero.
  type :: term_view_type
    type(body_type), pointer :: body => null()      !! positions, volumes, numbers of materials
    class(family_type), pointer :: family => null() !! `bonds_of` lists the bonds of a slot
    type(material_type), pointer, contiguous :: materials(:) => null()
    real(wp), pointer, contiguous :: u(:, :) => null()  !! displacements (n_slots, dim) [m]
    real(wp), pointer, contiguous :: v(:, :) => null()  !! velocities (n_slots, dim) [m/s], as the
                                                    !! integrator keeps them: forward_backward and
                                                    !! velocity_verlet half a step before `time`;
                                                    !! 0 in static equilibrium
    type(obstacle_type), pointer :: obstacles(:) => null()
                                                    !! surfaces of rigid bodies
    real(wp) :: time = 0.0_wp                       !! of the displacements [s]
    integer :: step = 0                             !! complete steps (iterations) then
  end type term_view_type

  type, abstract :: force_term_type
    character(:), allocatable :: name    !! by which messages speak of it
    logical :: external = .false.        !! its work is that of an external force, and the internal
                                         !! force density does not contain it
    logical :: conservative = .true.     !! internal terms: the force is minus the gradient of the
                                         !! energy; what others do not store counts as dissipated
    integer :: tangent = no_tangent      !! `no_tangent`, `has_tangent` or `no_stiffness`
    logical :: summed_apart = .false.    !! whoever holds it sums the work of its few points
    logical :: has_partner = .false.     !! it acts between points and what is no point
  contains
    procedure(add_force_interface), deferred :: add_force
    procedure(add_energy_interface), deferred :: add_energy
    procedure(add_bound_interface), deferred :: add_stiffness_bound
    procedure(keep_interface), deferred :: keep
    procedure(describe_interface), deferred :: describe
    procedure :: add_damping_bound => no_damping
    procedure :: add_tangent => no_change
    procedure :: begin => begin_nothing
    procedure :: advance => begin_nothing
    procedure :: subtract_partner => no_partner
  end type force_term_type

  abstract interface
    !> Add the term's force density [N/m3] to `force` (n_slots, dim). It may be called several times
    !> in a step and at displacements that are only tried.
    subroutine add_force_interface(self, view, force)
      import :: force_term_type, term_view_type, wp
      implicit none (type, external)
      class(force_term_type), intent(in) :: self  !! the term
      type(term_view_type), intent(in) :: view    !! the instant
      real(wp), intent(inout), contiguous :: force(:, :)
        !! (n_slots, dim) force density, added to [N/m3]
    end subroutine add_force_interface

    !> Add the energy density that the term stores [J/m3] to `density` (n_slots).
    subroutine add_energy_interface(self, view, density)
      import :: force_term_type, term_view_type, wp
      implicit none (type, external)
      class(force_term_type), intent(in) :: self  !! the term
      type(term_view_type), intent(in) :: view    !! the instant
      real(wp), intent(inout), contiguous :: density(:)
        !! (n_slots) energy density, added to [J/m3]
    end subroutine add_energy_interface

    !> Add a bound of the term's stiffness [N/m4] to `bound` (n_slots): for each slot the largest
    !> sum, over its components, of the absolute values of one row of minus the derivative of the
    !> force density with respect to all displacements, in any state the term may get into. A spring
    !> of s [N/m4] to the ground adds s; a bond of that stiffness to another point adds 2 s. The
    !> time step and the mass of relaxation come from it.
    subroutine add_bound_interface(self, view, bound)
      import :: force_term_type, term_view_type, wp
      implicit none (type, external)
      class(force_term_type), intent(in) :: self  !! the term
      type(term_view_type), intent(in) :: view    !! the instant
      real(wp), intent(inout), contiguous :: bound(:)
        !! (n_slots) bound of the stiffness, added to [N/m4]
    end subroutine add_bound_interface

    !> Keep what the term carries from one instant to the next, or put it back: by the same calls of
    !> `archive%keep`.
    subroutine keep_interface(self, archive)
      import :: archive_type, force_term_type
      implicit none (type, external)
      class(force_term_type), intent(inout) :: self  !! its history is set where the archive reads
      class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    end subroutine keep_interface

    !> What the term is, in a line of the summary; '' for no line.
    function describe_interface(self) result(text)
      import :: force_term_type
      implicit none (type, external)
      class(force_term_type), intent(in) :: self  !! the term
      character(:), allocatable :: text
    end function describe_interface
  end interface

  !> A term in a list, and the account of its work.
  type :: item_type
    class(force_term_type), allocatable :: term
    real(wp), allocatable :: last_u(:, :)      !! displacements and forces at the last instant
    real(wp), allocatable :: last_force(:, :)  !! that was accounted [m], [N/m3]
    real(wp) :: last_energy = 0.0_wp           !! that it stored then [J]
    real(wp) :: lost = 0.0_wp                  !! of a term that is not conservative: it took [J]
  end type item_type

  !> Terms in their order. It is a term itself: the sum of those that are not external.
  type, extends(force_term_type) :: term_list_type
    type(item_type), allocatable :: items(:)   !! not allocated: none
    integer :: inside = 0                      !! terms that are not external
    integer :: outside = 0                     !! external ones
  contains
    procedure :: add
    procedure :: number
    procedure :: add_force => add_force_of_list
    procedure :: add_external
    procedure :: add_energy => add_energy_of_list
    procedure :: energy
    procedure :: add_stiffness_bound => add_bound_of_list
    procedure :: add_damping_bound => add_damping_of_list
    procedure :: add_tangent => add_tangent_of_list
    procedure :: begin => begin_list
    procedure :: advance => advance_list
    procedure :: account
    procedure :: keep => keep_list
    procedure :: describe => describe_list
    procedure :: without_tangent
    procedure :: accounts_of
    procedure :: has
  end type term_list_type

contains

  !> The density of a point [kg/m3].
  pure real(wp) function density_of(view, k) result(density)
    type(term_view_type), intent(in) :: view   !! of the body
    integer, intent(in) :: k                   !! slot
    density = view%materials(view%body%material(k))%density
  end function density_of

  ! ---------------------------------------------------------------- a term, if it says no more

  !> Add a bound of the damping [N s/m4] to `bound` (n_slots), as that of the stiffness: of the
  !> derivative with respect to velocities. By default there is none.
  subroutine no_damping(self, view, bound)
    class(force_term_type), intent(in) :: self  !! the term
    type(term_view_type), intent(in) :: view    !! the instant
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the damping, added to [N s/m4]

    if (.not. (associated(view%u) .and. size(bound) > 0)) call misused(self)
  end subroutine no_damping

  !> Add to `kw` what the term resists to a small displacement `w` [m], minus the derivative of its
  !> force density in that direction [N/m3], both (n_slots, dim). It must be symmetric in the inner
  !> product weighted with volumes. A term that `has_tangent` has a procedure of its own.
  subroutine no_change(self, view, w, kw)
    class(force_term_type), intent(in) :: self   !! the term
    type(term_view_type), intent(in) :: view     !! the instant
    real(wp), intent(in), contiguous :: w(:, :)  !! (n_slots, dim) small displacement [m]
    real(wp), intent(inout), contiguous :: kw(:, :)
      !! (n_slots, dim) resistance to it, added to [N/m3]

    if (self%tangent /= no_stiffness .or. size(w) /= size(kw) .or. .not. associated(view%u)) &
      & call misused(self)
  end subroutine no_change

  !> `begin`: called once when the body is ready at the start. `advance`: called once for each
  !> complete step, at a settled state of static equilibrium too, when its forces are known: the
  !> place to bring a history up to date. By default there is nothing to do.
  subroutine begin_nothing(self, view)
    class(force_term_type), intent(inout) :: self
      !! the term, with its history up to date on return
    type(term_view_type), intent(in) :: view  !! the instant

    if (.not. associated(view%u)) call misused(self)
  end subroutine begin_nothing

  !> Take from the displacements `moved` since the last instant [m], (n_slots, dim), those of what
  !> the points push against, for a term that `has_partner`: the rest is what its force does work on
  !> without the work on the partner. A term that has one has a procedure of its own.
  subroutine no_partner(self, view, moved)
    class(force_term_type), intent(in) :: self  !! the term
    type(term_view_type), intent(in) :: view    !! the instant
    real(wp), intent(inout) :: moved(:, :)      !! (n_slots, dim) [m]

    if (size(moved) /= size(view%u) .or. self%has_partner) call misused(self)
  end subroutine no_partner

  !> A call that contradicts what a term says of itself.
  subroutine misused(self)
    class(force_term_type), intent(in) :: self
    call internal_fault('the force term '//name_of(self)//' was asked for what it does not have')
  end subroutine misused

  !> The term's name, or that it has none.
  function name_of(term) result(name)
    class(force_term_type), intent(in) :: term
    character(:), allocatable :: name

    name = 'without a name'
    if (allocated(term%name)) name = '"'//term%name//'"'
  end function name_of

  ! ---------------------------------------------------------------- the list

  !> Add a term, as the last one. Of a list, its terms are added one by one.
  recursive subroutine add(self, term)
    class(term_list_type), intent(inout) :: self  !! the list, with the term at its end on return
    class(force_term_type), intent(in) :: term   !! is copied
    type(item_type), allocatable :: items(:)
    integer :: i, n

    select type (term)
    class is (term_list_type)
      do i = 1, term%number()
        call self%add(term%items(i)%term)
      end do
      return
    class default  ! a single term
      continue
    end select
    n = self%number()
    allocate (items(n + 1))
    do i = 1, n
      call move_alloc(self%items(i)%term, items(i)%term)
    end do
    allocate (items(n + 1)%term, source=term)
    call move_alloc(items, self%items)
    if (term%external) then
      self%outside = self%outside + 1
    else
      self%inside = self%inside + 1
    end if
    self%conservative = self%conservative .and. (term%external .or. term%conservative)
  end subroutine add

  !> How many terms there are.
  pure integer function number(self)
    class(term_list_type), intent(in) :: self  !! the list

    number = 0
    if (allocated(self%items)) number = size(self%items)
  end function number

  !> The force density of the terms that are not external, added to `force`.
  subroutine add_force_of_list(self, view, force)
    class(term_list_type), intent(in) :: self  !! the list
    type(term_view_type), intent(in) :: view   !! the instant
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to [N/m3]
    integer :: i

    if (self%inside == 0) return
    do i = 1, self%number()
      if (.not. self%items(i)%term%external) call self%items(i)%term%add_force(view, force)
    end do
  end subroutine add_force_of_list

  !> The force density of the external terms that are not summed apart, added to `force`.
  subroutine add_external(self, view, force)
    class(term_list_type), intent(in) :: self           !! the list
    type(term_view_type), intent(in) :: view            !! the instant
    real(wp), intent(inout), contiguous :: force(:, :)  !! (n_slots, dim) [N/m3]
    integer :: i

    do i = 1, self%number()
      if (self%items(i)%term%external .and. .not. self%items(i)%term%summed_apart) &
        & call self%items(i)%term%add_force(view, force)
    end do
  end subroutine add_external

  !> The energy density that the terms store which are not external.
  subroutine add_energy_of_list(self, view, density)
    class(term_list_type), intent(in) :: self          !! the list
    type(term_view_type), intent(in) :: view           !! the instant
    real(wp), intent(inout), contiguous :: density(:)  !! (n_slots) energy density, added to [J/m3]
    integer :: i

    if (self%inside == 0) return
    do i = 1, self%number()
      if (.not. self%items(i)%term%external) call self%items(i)%term%add_energy(view, density)
    end do
  end subroutine add_energy_of_list

  !> The energy that the terms store which are not external [J].
  real(wp) function energy(self, view)
    class(term_list_type), intent(in) :: self  !! the list
    type(term_view_type), intent(in) :: view   !! the instant
    real(wp), allocatable :: density(:)

    energy = 0.0_wp
    if (self%inside == 0) return
    allocate (density(view%body%n_slots), source=0.0_wp)
    call self%add_energy(view, density)
    energy = inner(view%body%order, density, view%body%volume)
  end function energy

  !> Bounds of all terms, external ones included: they act on the motion as well.
  subroutine add_bound_of_list(self, view, bound)
    class(term_list_type), intent(in) :: self  !! the list
    type(term_view_type), intent(in) :: view   !! the instant
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the stiffness, added to [N/m4]
    integer :: i

    do i = 1, self%number()
      call self%items(i)%term%add_stiffness_bound(view, bound)
    end do
  end subroutine add_bound_of_list

  !> As above, of the damping.
  subroutine add_damping_of_list(self, view, bound)
    class(term_list_type), intent(in) :: self  !! the list
    type(term_view_type), intent(in) :: view   !! the instant
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the damping, added to [N s/m4]
    integer :: i

    do i = 1, self%number()
      call self%items(i)%term%add_damping_bound(view, bound)
    end do
  end subroutine add_damping_of_list

  !> What all terms resist, external ones included.
  subroutine add_tangent_of_list(self, view, w, kw)
    class(term_list_type), intent(in) :: self    !! the list
    type(term_view_type), intent(in) :: view     !! the instant
    real(wp), intent(in), contiguous :: w(:, :)  !! (n_slots, dim) small displacement [m]
    real(wp), intent(inout), contiguous :: kw(:, :)
      !! (n_slots, dim) resistance to it, added to [N/m3]
    integer :: i

    do i = 1, self%number()
      if (self%items(i)%term%tangent /= no_stiffness) &
        & call self%items(i)%term%add_tangent(view, w, kw)
    end do
  end subroutine add_tangent_of_list

  !> All terms begin.
  subroutine begin_list(self, view)
    class(term_list_type), intent(inout) :: self  !! the list, with its terms begun on return
    type(term_view_type), intent(in) :: view      !! the start
    integer :: i

    do i = 1, self%number()
      call self%items(i)%term%begin(view)
    end do
  end subroutine begin_list

  !> All terms advance to the instant of the view.
  subroutine advance_list(self, view)
    class(term_list_type), intent(inout) :: self
      !! the list, with the histories of its terms up to date on return
    type(term_view_type), intent(in) :: view  !! the instant
    integer :: i

    do i = 1, self%number()
      call self%items(i)%term%advance(view)
    end do
  end subroutine advance_list

  !> Work since the last call, by the trapezoidal rule: that of external terms adds to `supplied`,
  !> what terms that are not conservative took and do not store to `lost`. To be called once per
  !> step, when the forces are known.
  subroutine account(self, view, supplied, lost)
    class(term_list_type), intent(inout) :: self
      !! the list; keeps displacements, forces and energies of this instant
    type(term_view_type), intent(in) :: view        !! the instant
    real(wp), intent(inout) :: supplied             !! [J]
    real(wp), intent(inout) :: lost                 !! [J]
    real(wp), allocatable :: force(:, :), density(:), moved(:, :)
    real(wp) :: work, stored
    integer :: i

    do i = 1, self%number()
      associate (item => self%items(i))
        if (item%term%summed_apart) cycle
        if (.not. item%term%external .and. item%term%conservative) cycle
        if (.not. allocated(force)) allocate (force, mold=view%u)
        if (.not. allocated(density)) allocate (density(size(view%u, 1)))
        force = 0.0_wp
        call item%term%add_force(view, force)
        stored = 0.0_wp
        if (.not. item%term%external) then
          density = 0.0_wp
          call item%term%add_energy(view, density)
          stored = inner(view%body%order, density, view%body%volume)
        end if
        if (allocated(item%last_u)) then
          if (item%term%has_partner) then
            moved = view%u - item%last_u
            call item%term%subtract_partner(view, moved)
            density = sum((item%last_force + force)/2*moved, 2)
          else
            density = sum((item%last_force + force)/2*(view%u - item%last_u), 2)
          end if
          work = inner(view%body%order, density, view%body%volume)
          if (item%term%external) then
            supplied = supplied + work
          else
            lost = lost - work - (stored - item%last_energy)
            item%lost = item%lost - work - (stored - item%last_energy)
          end if
        end if
        item%last_u = view%u
        item%last_force = force
        item%last_energy = stored
      end associate
    end do
  end subroutine account

  !> Keep all terms and the accounts of their work.
  subroutine keep_list(self, archive)
    class(term_list_type), intent(inout) :: self
      !! the list; histories and accounts are set where the archive reads
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    integer :: i

    do i = 1, self%number()
      associate (item => self%items(i))
        call item%term%keep(archive)
        if (item%term%summed_apart) cycle
        call archive%keep('last place of term '//to_text(i), item%last_u)
        call archive%keep('last force of term '//to_text(i), item%last_force)
        call archive%keep('last energy of term '//to_text(i), item%last_energy)
        call archive%keep('loss of term '//to_text(i), item%lost)
      end associate
    end do
  end subroutine keep_list

  !> The lines of all terms, each ended by a newline.
  function describe_list(self) result(text)
    class(term_list_type), intent(in) :: self  !! the list
    character(:), allocatable :: text, one
    integer :: i

    text = ''
    do i = 1, self%number()
      one = self%items(i)%term%describe()
      if (one /= '') text = text//one//new_line('a')
    end do
  end function describe_list

  !> What the terms of a name store and, if they are not conservative, have taken, at the instant
  !> that was last accounted.
  subroutine accounts_of(self, view, name, stored, lost)
    class(term_list_type), intent(in) :: self  !! the list
    type(term_view_type), intent(in) :: view   !! that instant
    character(*), intent(in) :: name           !! of the terms
    real(wp), intent(out) :: stored            !! [J]
    real(wp), intent(out) :: lost              !! since the start [J]
    real(wp), allocatable :: density(:)
    integer :: i

    stored = 0.0_wp
    lost = 0.0_wp
    do i = 1, self%number()
      associate (item => self%items(i))
        if (.not. allocated(item%term%name)) cycle
        if (item%term%name /= name) cycle
        if (item%term%conservative) then
          allocate (density(view%body%n_slots), source=0.0_wp)
          call item%term%add_energy(view, density)
          stored = stored + inner(view%body%order, density, view%body%volume)
          deallocate (density)
        else
          stored = stored + item%last_energy
          lost = lost + item%lost
        end if
      end associate
    end do
  end subroutine accounts_of

  !> Whether there is a term of this name.
  pure logical function has(self, name)
    class(term_list_type), intent(in) :: self  !! the list
    character(*), intent(in) :: name           !! of a term
    integer :: i

    has = .false.
    do i = 1, self%number()
      if (.not. allocated(self%items(i)%term%name)) cycle
      has = has .or. self%items(i)%term%name == name
    end do
  end function has

  !> The name of the first term whose force depends on displacements and that has no tangent; '' if
  !> there is none.
  function without_tangent(self) result(name)
    class(term_list_type), intent(in) :: self  !! the list
    character(:), allocatable :: name
    integer :: i

    name = ''
    do i = 1, self%number()
      if (self%items(i)%term%tangent /= no_tangent) cycle
      name = name_of(self%items(i)%term)
      return
    end do
  end function without_tangent

end module pd_force_term
